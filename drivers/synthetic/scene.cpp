// A simulated booth: who stands where at an instant, each camera's own instants, and the truth.
#include "drivers/synthetic/scene.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <stdexcept>

#include "drivers/pacing/timeline.hpp"
#include "drivers/synthetic/instants.hpp"
#include "drivers/synthetic/renderer.hpp"

namespace booth::drivers {
namespace {

void require(bool ok, const std::string& what) {
  if (!ok) throw std::invalid_argument("synthetic scene: " + what);
}

/// Hair: the crown and the back of the head.
std::vector<std::uint8_t> dark_faces(const Person& person) {
  const auto& d = person.model->data();
  const int head = fit::bone_index("head");
  const Eigen::Vector3d base = person.rest_joints.col(fit::joint_index("head_base")), top = person.rest_joints.col(fit::joint_index("head_top"));
  const auto hair = [&](int v) {
    if (d.skin_bone(0, v) != head) return false;
    const Eigen::Vector3d p = person.rest.col(v).cast<double>() - base;
    return p.y() > 0.6 * (top - base).y() || (p.z() < -0.03 && p.y() > -0.05);
  };
  std::vector<std::uint8_t> dark(static_cast<std::size_t>(d.faces.cols()));
  for (int f = 0; f < d.faces.cols(); ++f) dark[static_cast<std::size_t>(f)] = hair(d.faces(0, f)) && hair(d.faces(1, f)) && hair(d.faces(2, f));
  return dark;
}

/// The scene itself: immutable after construction but for its timeline, so cameras may render it at once.
class SyntheticBooth {
 public:
  SyntheticBooth(SceneSettings settings, std::vector<Person> persons, std::shared_ptr<hal::Clock> clock)
      : settings_(std::move(settings)),
        persons_(std::move(persons)),
        timeline_(settings_.pace, std::move(clock), static_cast<int>(settings_.cameras.size()), 2 * frame_period(settings_.cameras.front())) {
    for (const Person& p : persons_) dark_.push_back(dark_faces(p));
  }

  const SceneSettings& settings() const { return settings_; }
  const std::vector<Person>& persons() const { return persons_; }
  const std::vector<std::uint8_t>& dark(std::size_t person) const { return dark_[person]; }
  Timeline& timeline() { return timeline_; }
  const Timeline& timeline() const { return timeline_; }

  static bool present(const Person& p, double t) { return t >= p.enters && t < p.leaves; }
  static fit::PoseVector pose(const Person& p, double t) {
    fit::PoseVector q = p.motion.at(t - p.enters);
    q[2] += p.stand_at.x();  // booth x is CMU z, booth y is CMU x
    q[0] += p.stand_at.y();
    return q;
  }

 private:
  SceneSettings settings_;
  std::vector<Person> persons_;
  std::vector<std::vector<std::uint8_t>> dark_;
  Timeline timeline_;
};

class SyntheticCamera final : public hal::DepthCamera {
 public:
  SyntheticCamera(std::shared_ptr<SyntheticBooth> booth, int index)
      : booth_(std::move(booth)),
        index_(index),
        description_(booth_->settings().cameras[static_cast<std::size_t>(index)]),
        instants_(booth_->settings(), index),
        delay_(hal::from_seconds(booth_->settings().delivery_delay)),
        renderer_(description_, index, booth_->settings()),
        depth_(static_cast<std::size_t>(description_.intrinsics.width) * static_cast<std::size_t>(description_.intrinsics.height)) {
    Eigen::Index most = 0;
    for (const Person& p : booth_->persons()) most = std::max(most, p.rest.cols());
    renderer_.reserve(static_cast<int>(most));
    booth_->timeline().advance(index_, instants_.at(0), false);
    posed_.resize(booth_->persons().size());
    for (std::size_t i = 0; i < posed_.size(); ++i) posed_[i].resize(3, booth_->persons()[i].rest.cols());
  }

  const hal::CameraDescription& description() const override { return description_; }

  void start() override {
    if (streaming_.exchange(true)) return;
    if (started_before_.exchange(true)) ++restarts_;
    resumed_ = true;
    booth_->timeline().enter(index_);
  }

  void stop() noexcept override {
    if (streaming_.exchange(false)) booth_->timeline().leave(index_);
  }

  hal::ReadStatus read(hal::DepthFrame& slot, hal::Nanoseconds timeout) override {
    auto& timeline = booth_->timeline();
    if (!streaming_) return hal::ReadStatus::ended;
    if (timeline.pace() == Pace::own) skip_what_was_missed();
    if (hal::seconds(instants_.at(next_)) >= booth_->settings().seconds) {
      timeline.advance(index_, instants_.at(next_), true);
      return hal::ReadStatus::ended;
    }
    // The picture is made before it is due, so that rendering adds nothing to the latency.
    if (!rendered_) render();
    switch (timeline.wait(index_, instants_.at(next_), delay_, timeout)) {
      case Timeline::Wait::stopped:
        return hal::ReadStatus::ended;
      case Timeline::Wait::timeout:
        return hal::ReadStatus::timeout;
      case Timeline::Wait::due:
        break;
    }
    if (slot.depth.size() != depth_.size()) slot.depth.resize(depth_.size());
    slot.depth.swap(depth_);
    slot.camera = static_cast<hal::CameraIndex>(index_);
    slot.sequence = next_;
    slot.captured = timeline.origin() + instants_.at(next_);
    slot.received = timeline.pace() == Pace::own ? timeline.clock().now() : slot.captured + delay_;
    ++next_;
    rendered_ = false;
    ++delivered_;
    timeline.advance(index_, instants_.at(next_), false);
    return hal::ReadStatus::frame;
  }

  hal::CameraCounters counters() const override { return {delivered_, dropped_, 0, restarts_}; }
  std::string last_error() const override { return {}; }

  /// The picture at an instant that somebody else chose; frames are numbered as they are asked for.
  void look(hal::MonotonicTime at, std::span<std::uint16_t> out) { draw(hal::seconds(at - booth_->timeline().origin()), next_++, out.data()); }

  /// The room without anybody in it.
  hal::DepthFrame background() {
    hal::DepthFrame frame;
    frame.camera = static_cast<hal::CameraIndex>(index_);
    frame.depth.resize(depth_.size());
    renderer_.begin();
    renderer_.finish(~std::uint64_t{0}, frame.depth.data());
    return frame;
  }

 private:
  hal::MonotonicTime due(std::uint64_t k) const { return booth_->timeline().origin() + instants_.at(k) + delay_; }

  void skip_what_was_missed() {
    const auto now = booth_->timeline().clock().now();
    // Frames of before the start were not missed: nobody was looking.
    if (resumed_.exchange(false))
      while (due(next_) < now) ++next_, rendered_ = false;
    while (due(next_ + 1) <= now) {
      ++next_;
      ++dropped_;
      rendered_ = false;
    }
  }

  void render() {
    draw(hal::seconds(instants_.at(next_)), next_, depth_.data());
    rendered_ = true;
  }

  void draw(double t, std::uint64_t frame, std::uint16_t* out) {
    renderer_.begin();
    for (std::size_t i = 0; i < posed_.size(); ++i) {
      const Person& p = booth_->persons()[i];
      if (!SyntheticBooth::present(p, t)) continue;
      p.model->pose_mesh(p.rest, p.rest_joints, SyntheticBooth::pose(p, t), posed_[i]);
      renderer_.draw(posed_[i], p.model->data().faces, booth_->dark(i));
    }
    renderer_.finish(frame, out);
  }

  const std::shared_ptr<SyntheticBooth> booth_;
  const int index_;
  const hal::CameraDescription description_;
  const Instants instants_;
  const hal::Nanoseconds delay_;
  Renderer renderer_;
  std::vector<std::uint16_t> depth_;
  std::vector<fit::Vertices> posed_;
  std::uint64_t next_ = 0;
  bool rendered_ = false;
  std::atomic<bool> streaming_{false}, resumed_{false}, started_before_{false};
  std::atomic<std::uint64_t> delivered_{0}, dropped_{0}, restarts_{0};
};

class SyntheticTruth final : public hal::GroundTruth {
 public:
  explicit SyntheticTruth(std::shared_ptr<const SyntheticBooth> booth) : booth_(std::move(booth)) {
    const auto& f = person().model->data().faces;
    for (int i = 0; i < f.cols(); ++i) faces_.push_back({f(0, i), f(1, i), f(2, i)});
  }

  std::string body_name() const override { return person().name; }
  std::string sex() const override { return fit::to_string(person().model->sex()); }

  std::optional<hal::TruthSample> at(hal::MonotonicTime t) const override {
    const auto q = pose(t);
    if (!q) return std::nullopt;
    fit::Kinematics kin;
    fit::forward_kinematics(*q, person().model->bone_vectors_from_joints(person().rest_joints), kin);
    hal::TruthSample sample;
    std::copy(q->begin(), q->end(), sample.q.begin());
    for (int j = 0; j < fit::kJoints; ++j) {
      const Eigen::Vector3d p = fit::booth_from_cmu(kin.joint.col(j));
      sample.joints[static_cast<std::size_t>(j)] = {p.x(), p.y(), p.z()};
    }
    return sample;
  }

  std::vector<std::array<float, 3>> surface(hal::MonotonicTime t) const override {
    std::vector<std::array<float, 3>> out;
    if (const auto q = pose(t)) {
      fit::Vertices v;
      person().model->pose_mesh(person().rest, person().rest_joints, *q, v);
      for (int i = 0; i < v.cols(); ++i) out.push_back({v(2, i), v(0, i), v(1, i)});
    }
    return out;
  }

  const std::vector<std::array<int, 3>>& faces() const override { return faces_; }

 private:
  const Person& person() const { return booth_->persons().front(); }
  std::optional<fit::PoseVector> pose(hal::MonotonicTime when) const {
    const double t = hal::seconds(when - booth_->timeline().origin());
    if (!booth_->timeline().begun() || t < 0 || t > booth_->settings().seconds || !SyntheticBooth::present(person(), t)) return std::nullopt;
    return SyntheticBooth::pose(person(), t);
  }

  const std::shared_ptr<const SyntheticBooth> booth_;
  std::vector<std::array<int, 3>> faces_;
};

}  // namespace

Contact contact_of(const fit::BodyModel& model, const fit::Vertices& rest, const fit::Points3& rest_joints) {
  Contact contact;
  contact.bone_vectors = model.bone_vectors_from_joints(rest_joints);
  for (const char* name : {"lfoot", "ltoes", "rfoot", "rtoes"}) {
    const int bone = fit::bone_index(name);
    std::vector<int> mine;
    for (int v = 0; v < rest.cols(); ++v)
      if (model.data().skin_bone(0, v) == bone) mine.push_back(v);
    // A sole is what lies lowest; the instep never touches the floor first.
    std::sort(mine.begin(), mine.end(), [&](int a, int b) { return rest(1, a) < rest(1, b); });
    mine.resize((mine.size() + 1) / 2);
    for (const int v : mine)
      contact.soles.push_back({bone, model.rest_rotation(bone).transpose() * (rest.col(v).cast<double>() - rest_joints.col(fit::start_joint(bone)))});
  }
  return contact;
}

double leg_scale(const fit::BodyModel& model, const fit::Points3& rest_joints) {
  const fit::Points3 own = model.bone_vectors_from_joints(rest_joints);
  const fit::Points3& average = fit::average_bone_vectors();
  const int thigh = fit::bone_index("lfemur"), shank = fit::bone_index("ltibia");
  return (own.col(thigh).norm() + own.col(shank).norm()) / (average.col(thigh).norm() + average.col(shank).norm());
}

Person make_person(std::string name, std::shared_ptr<const fit::BodyModel> model, const fit::ShapeVector& beta, Motion motion) {
  fit::Vertices rest;
  model->shaped(beta, rest);
  const fit::Points3 joints = model->rest_joints(beta);
  Person p = make_person(std::move(name), std::move(model), std::move(rest), joints, std::move(motion));
  p.beta = beta;
  return p;
}

Person make_person(std::string name, std::shared_ptr<const fit::BodyModel> model, fit::Vertices rest, const fit::Points3& rest_joints, Motion motion) {
  require(model != nullptr, "a person needs a body model");
  require(rest.cols() == model->vertex_count(),
          "the body '" + name + "' has " + std::to_string(rest.cols()) + " vertices, its model " + std::to_string(model->vertex_count()));
  require(!motion.frames.empty(), "the motion of '" + name + "' has no frames");
  Person p;
  p.name = std::move(name);
  p.model = std::move(model);
  p.rest = std::move(rest);
  p.rest_joints = rest_joints;
  p.motion = std::move(motion);
  return p;
}

std::vector<Box> chair(double x, double y) {
  constexpr double kHalf = 0.22, kSeat = 0.45, kBack = 0.90, kLeg = 0.04;
  std::vector<Box> boxes{{{x - kHalf, y - kHalf, kSeat - 0.04}, {x + kHalf, y + kHalf, kSeat}},
                         {{x - kHalf, y - kHalf, kSeat}, {x - kHalf + 0.04, y + kHalf, kBack}}};
  for (const double sx : {x - kHalf, x + kHalf - kLeg})
    for (const double sy : {y - kHalf, y + kHalf - kLeg}) boxes.push_back({{sx, sy, 0}, {sx + kLeg, sy + kLeg, kSeat - 0.04}});
  return boxes;
}

std::vector<hal::CameraDescription> camera_ring(int count) {
  static constexpr std::array<const char*, 4> kCorners{"front-left", "back-left", "back-right", "front-right"};
  std::vector<hal::CameraDescription> ring;
  for (int i = 0; i < count; ++i) {
    hal::CameraDescription c;
    c.name = count == 4 ? kCorners[static_cast<std::size_t>(i)] : "camera-" + std::to_string(i);
    c.serial = "synthetic-" + std::to_string(i);
    c.intrinsics = {512, 424, 365.5, 365.5, 254.9, 205.4, {0.09, -0.27, 0, 0, 0.09}};
    const double angle = EIGEN_PI / 4 + 2 * EIGEN_PI * i / count, radius = 2 * std::sqrt(2.0);
    const Eigen::Vector3d position(radius * std::cos(angle), radius * std::sin(angle), 1.6), target(0, 0, 0.95);
    const Eigen::Vector3d z = (target - position).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized(), y = z.cross(x);
    for (std::size_t row = 0; row < 3; ++row) {
      const auto r = static_cast<Eigen::Index>(row);
      c.camera_to_world.rotation[3 * row] = x[r];
      c.camera_to_world.rotation[3 * row + 1] = y[r];
      c.camera_to_world.rotation[3 * row + 2] = z[r];
      c.camera_to_world.translation[row] = position[r];
    }
    ring.push_back(c);
  }
  return ring;
}

namespace {

std::shared_ptr<SyntheticBooth> make_booth(SceneSettings settings, std::vector<Person> persons, std::shared_ptr<hal::Clock> clock) {
  if (settings.cameras.empty()) settings.cameras = camera_ring();
  require(clock != nullptr, "a clock is needed");
  require(settings.cameras.size() <= 64, "there are " + std::to_string(settings.cameras.size()) + " cameras, allowed are 1 to 64");
  for (const auto& c : settings.cameras) {
    const auto& k = c.intrinsics;
    require(k.width >= 8 && k.height >= 8 && k.width <= 4096 && k.height <= 4096,
            "camera '" + c.name + "' has " + std::to_string(k.width) + " x " + std::to_string(k.height) + " pixels, allowed are 8 to 4096 each way");
    require(k.fx > 0 && k.fy > 0 && std::isfinite(k.fx + k.fy + k.cx + k.cy), "camera '" + c.name + "' has a focal length or centre that is no number above 0");
    require(c.depth_scale > 0 && c.nominal_rate > 0 && c.nominal_rate <= 1000, "camera '" + c.name + "' has a depth scale or rate that is not above 0");
  }
  require(settings.phase_spread >= 0 && settings.phase_spread < 10, "phase_spread must be 0 to 10 seconds");
  require(settings.jitter >= 0 && settings.jitter <= 0.005, "jitter must be 0 to 5 milliseconds");
  require(settings.delivery_delay >= 0 && settings.delivery_delay < 10, "delivery_delay must be 0 to 10 seconds");
  require(settings.range_min >= 0 && settings.range_max > settings.range_min, "range_max must be above range_min");
  require(settings.seconds >= 0, "seconds must not be negative");

  return std::make_shared<SyntheticBooth>(std::move(settings), std::move(persons), std::move(clock));
}

std::shared_ptr<const hal::GroundTruth> truth_of(const std::shared_ptr<SyntheticBooth>& booth) {
  return booth->persons().empty() ? nullptr : std::make_shared<SyntheticTruth>(booth);
}

}  // namespace

Source make_scene(SceneSettings settings, std::vector<Person> persons, std::shared_ptr<hal::Clock> clock) {
  const auto booth = make_booth(std::move(settings), std::move(persons), std::move(clock));
  Source source;
  for (int i = 0; i < static_cast<int>(booth->settings().cameras.size()); ++i) {
    auto camera = std::make_unique<SyntheticCamera>(booth, i);
    source.background.push_back(camera->background());
    source.cameras.push_back(std::move(camera));
  }
  source.truth = truth_of(booth);
  return source;
}

SceneViews make_scene_views(SceneSettings settings, std::vector<Person> persons, std::shared_ptr<hal::Clock> clock) {
  settings.pace = Pace::own;
  const auto booth = make_booth(std::move(settings), std::move(persons), std::move(clock));
  booth->timeline().enter(0);
  SceneViews views;
  for (int i = 0; i < static_cast<int>(booth->settings().cameras.size()); ++i) {
    const auto camera = std::make_shared<SyntheticCamera>(booth, i);
    views.background.push_back(camera->background());
    views.cameras.push_back([camera](hal::MonotonicTime at, std::span<std::uint16_t> depth) { camera->look(at, depth); });
  }
  views.truth = truth_of(booth);
  return views;
}

}  // namespace booth::drivers

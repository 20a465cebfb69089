// Frames go from the renderer to the fit one group at a time: a minute of them would not fit into memory.
#include "tests/accuracy/booth/motion_run.hpp"

#include <time.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <stdexcept>

#include "daemon/io/mocap_folder.hpp"
#include "drivers/clock/manual_clock.hpp"
#include "drivers/pacing/timeline.hpp"
#include "drivers/synthetic/motions.hpp"
#include "drivers/synthetic/scene.hpp"

namespace booth::accuracy {
namespace {

double thread_ms() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

drivers::Motion motion_of(const Subject& subject, const Clip& clip, const MotionSettings& settings) {
  const auto contact = drivers::contact_of(*subject.model, subject.body->rest, subject.body->rest_joints);
  drivers::Motion motion;
  if (clip.frames.empty()) {
    motion = drivers::motion_by_name(clip.name, settings.seconds, contact);
  } else {
    motion.frames = clip.frames;
    const auto most = static_cast<std::size_t>(std::lround(settings.seconds * motion.rate)) + 1;
    if (motion.frames.size() > most) motion.frames.resize(most);
    drivers::place_on_stage(motion, contact, {.leg_scale = drivers::leg_scale(*subject.model, subject.body->rest_joints)});
  }
  const double c = std::cos(settings.heading), s = std::sin(settings.heading);
  for (auto& q : motion.frames) {
    q.head<3>() = Eigen::Vector3d(c * q[0] + s * q[2], q[1], c * q[2] - s * q[0]);
    q[4] += settings.heading;
  }
  return motion;
}

}  // namespace

std::vector<Clip> held_out_clips(const Request& request) {
  std::vector<Clip> out;
  if (request.data.empty()) {
    for (const auto name : drivers::motion_names())
      if (name != "showcase") out.push_back({std::string(name)});
    return out;
  }
  const daemon::MotionFolder folder = daemon::load_motion_folder(request.data, request.subjects->folder() / "held_out_motions.csv");
  std::map<std::string, int> taken;
  for (const auto& clip : folder.clips) {
    constexpr int kShortest = 40;  // people run through the recorded volume in 1.4 s
    const int most = request.short_form ? 1 : 3;
    if (clip.use != daemon::MotionUse::held_out || clip.frames < kShortest || taken[clip.motion_class]++ >= most) continue;
    Clip c{clip.motion_class + " (" + clip.name + ")"};
    for (int k = 0; k < clip.frames; ++k) c.frames.push_back(folder.q.col(clip.start + k).cast<double>());
    out.push_back(std::move(c));
  }
  if (request.short_form) return out;
  // Kicks, rolling hands and bends are not among the recorded ones.
  for (const char* own : {"kick", "roll-hands", "squat"}) out.push_back({own});
  return out;
}

void follow(const Subjects& subjects, const Subject& subject, const Clip& clip, const MotionSettings& settings,
            const std::function<bool(const Sighting&)>& each) {
  drivers::SceneSettings scene;
  scene.noise = settings.noise;
  scene.seed = settings.seed;
  scene.pace = drivers::Pace::fast;
  drivers::Motion motion = motion_of(subject, clip, settings);
  // A clip shorter than asked for ends with its last frame; the project's own go on as long as one likes.
  const double length = clip.frames.empty() ? settings.seconds : std::min(settings.seconds, motion.seconds());
  const auto groups = static_cast<int>(std::lround(length * 30));
  scene.seconds = length + 0.2;
  const auto path = std::make_shared<const drivers::Motion>(motion);
  auto person = drivers::make_person("test:" + std::to_string(subject.number), subject.model, subject.body->rest, subject.body->rest_joints, std::move(motion));
  drivers::Source source = drivers::make_scene(scene, {std::move(person)}, std::make_shared<drivers::ManualClock>());

  std::vector<hal::CameraDescription> cameras;
  for (const auto& c : source.cameras) cameras.push_back(c->description());
  fit::CloudSettings cloud;
  cloud.threads = 1;
  fit::EstimatorSettings estimator;
  estimator.threads = 1;
  daemon::EstimatorFitter fitter(cameras, source.background, subjects.models(), cloud, estimator);
  for (auto& c : source.cameras) c->start();
  std::vector<hal::DepthFrame> frames(source.cameras.size());
  for (int k = 0; k < groups; ++k) {
    stop_if_requested();
    daemon::FitInput input;
    input.frame = static_cast<std::uint64_t>(k);
    hal::Nanoseconds sum{};
    int seeing = 0;
    for (std::size_t c = 0; c < frames.size(); ++c) {
      if (source.cameras[c]->read(frames[c], std::chrono::seconds(60)) != hal::ReadStatus::frame) throw std::runtime_error("a simulated camera ended early");
      if (((settings.cameras >> c) & 1u) == 0) continue;
      input.frames[c] = &frames[c];
      sum += frames[c].captured.time_since_epoch();
      ++seeing;
    }
    input.reference = hal::MonotonicTime(sum / seeing);
    const double instant = hal::seconds(input.reference - drivers::Timeline::kFastOrigin);
    daemon::FrameRecord record;
    const double before = thread_ms();
    fitter.step(input, record);
    Sighting s;
    s.milliseconds = thread_ms() - before;
    s.frame = k;
    s.time = k / 30.0;
    s.result = &fitter.result();
    s.estimator = &fitter.estimator();
    s.truth_at = [path, instant](double later) { return path->at(std::max(0.0, instant + later)); };
    s.truth = s.truth_at(0);
    if (!each(s)) break;
  }
  for (auto& c : source.cameras) c->stop();
}

}  // namespace booth::accuracy

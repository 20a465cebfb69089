// Table start: whether a person is found from nothing, in any pose and facing anywhere, and how soon another one after they left.
#include <fmt/format.h>
#include <time.h>

#include "drivers/clock/manual_clock.hpp"
#include "drivers/pacing/timeline.hpp"
#include "drivers/synthetic/motions.hpp"
#include "drivers/synthetic/scene.hpp"
#include "tests/accuracy/booth/poses.hpp"
#include "tests/accuracy/booth/stills.hpp"
#include "tests/accuracy/methods/estimator_method.hpp"
#include "tests/accuracy/tables/tables.hpp"

namespace booth::accuracy {
namespace {

constexpr double kFound = 0.05;  // m; mean error of the 15 main joints
constexpr std::uint64_t kSeed = 20170607;

double thread_seconds() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Some poses of one kind and one body: one unit of work.
Samples find_all(const Subjects& subjects, int body, PoseKind kind, int poses, const Eigen::MatrixXf& recorded) {
  const Subject subject = subjects.get(body);
  Random random(kSeed, static_cast<std::uint64_t>(1000 * body + static_cast<int>(kind)));
  std::vector<fit::PoseVector> truth;
  for (int k = 0; k < poses; ++k) truth.push_back(anywhere(subject, random_pose(subject, kind, recorded, random), 0.35, random));
  const Stills stills = render_stills(subject, truth, {}, kSeed + static_cast<std::uint64_t>(body));
  Booth booth;
  const auto estimator = make_estimator(subjects, fit::Preset::booth, fit::SexChoice::automatic);
  Samples out;
  const auto name = name_of(kind);
  for (std::size_t k = 0; k < truth.size(); ++k) {
    stop_if_requested();
    const fit::Observation& observation = booth.look(stills, k);
    estimator->reset();
    const double before = thread_seconds();
    const fit::FitResult& result = estimator->step(observation);
    const double spent = thread_seconds() - before;
    const bool seen = result.state != fit::FitState::lost;
    const double error = main_joint_error(result.joints, subject.joints(truth[k]));
    record(out, name, "booth", "success (joints < 5 cm)", "percent", seen && error < kFound ? 100 : 0);
    if (seen) record(out, name, "booth", "15 main joints", "cm", 100 * error);
    if (seen && error < kFound) record(out, name, "booth", "15 main joints where found", "cm", 100 * error);
    record(out, name, "booth", "processor time of a start, one thread", "s", spent);
    if (seen) record(out, name, "booth", "right sex at once", "percent", result.sex == subject.sex() ? 100 : 0);
  }
  return out;
}

/// One person leaves, half a second later another one stands there: scene time from their first frame until they are found.
Samples reacquire(const Subjects& subjects, int first, int second, const char* motion) {
  constexpr double kLeaves = 1.0, kEnters = 1.5, kLength = 4.0;
  drivers::SceneSettings scene;
  scene.seed = kSeed;
  scene.pace = drivers::Pace::fast;
  scene.seconds = kLength + 0.2;
  std::vector<drivers::Person> persons;
  for (const int number : {first, second}) {
    const Subject s = subjects.get(number);
    drivers::Motion m = drivers::motion_by_name(number == first ? "walk" : motion, kLength, drivers::contact_of(*s.model, s.body->rest, s.body->rest_joints));
    persons.push_back(drivers::make_person(std::to_string(number), s.model, s.body->rest, s.body->rest_joints, std::move(m)));
  }
  persons[0].leaves = kLeaves;
  persons[1].enters = kEnters;
  const drivers::Motion path = persons[1].motion;
  const Subject subject = subjects.get(second);
  drivers::Source source = drivers::make_scene(scene, std::move(persons), std::make_shared<drivers::ManualClock>());
  std::vector<hal::CameraDescription> cameras;
  for (const auto& c : source.cameras) cameras.push_back(c->description()), c->start();
  fit::CloudSettings cloud;
  cloud.threads = 1;
  fit::EstimatorSettings settings;
  settings.threads = 1;
  daemon::EstimatorFitter fitter(cameras, source.background, subjects.models(), cloud, settings);
  Samples out;
  std::vector<hal::DepthFrame> frames(source.cameras.size());
  double found = kLength - kEnters;  // not found: as long as was waited
  for (std::uint64_t k = 0; k < static_cast<std::uint64_t>(kLength * 30); ++k) {
    stop_if_requested();
    daemon::FitInput input;
    input.frame = k;
    hal::Nanoseconds sum{};
    for (std::size_t c = 0; c < frames.size(); ++c) {
      if (source.cameras[c]->read(frames[c], std::chrono::seconds(60)) != hal::ReadStatus::frame) throw std::runtime_error("a simulated camera ended early");
      input.frames[c] = &frames[c];
      sum += frames[c].captured.time_since_epoch();
    }
    input.reference = hal::MonotonicTime(sum / static_cast<int>(frames.size()));
    daemon::FrameRecord record_of_frame;
    fitter.step(input, record_of_frame);
    const double since = hal::seconds(input.reference - drivers::Timeline::kFastOrigin) - kEnters;
    if (since < 0 || fitter.result().state == fit::FitState::lost) continue;
    if (main_joint_error(fitter.result().joints, subject.joints(path.at(since))) >= kFound) continue;
    found = since;
    break;
  }
  record(out, "another person half a second later", "booth", "scene time until found", "s", found);
  record(out, "another person half a second later", "booth", "found within 0.5 s", "percent", found <= 0.5 ? 100 : 0);
  return out;
}

}  // namespace

Plan plan_start(const Request& request) {
  Plan plan;
  plan.protocol = fmt::format(
      "Every pose is one frame of four cameras with Kinect v2 noise; the estimator (preset `booth`, men and women both possible) knows nothing before it. The "
      "heading is "
      "even over the whole turn, the place within 35 cm of the centre. Standing poses are {}; the other kinds are written, with every angle drawn at random. "
      "Found means a mean error "
      "of the 15 main joints below 5 cm. Bodies are set-aside ones, men and women in equal numbers. Times are processor time of one thread.",
      request.data.empty() ? "instants of the project's own motions, every angle then moved by up to 6 degrees"
                           : "frames of recorded motions that were set aside before training");
  const auto recorded =
      std::make_shared<const Eigen::MatrixXf>(request.data.empty() ? Eigen::MatrixXf(fit::kDofs, 0) : held_out_frames(request.data, *request.subjects, 5));
  // 500 poses: 90 bodies, three standing ones and, in turns, the others.
  const int step = request.short_form ? 15 : 1;
  for (int body = 1; body <= request.subjects->count(); body += step) {
    for (const PoseKind kind : kPoseKinds) {
      const int poses = request.short_form ? 1 : kind == PoseKind::standing ? 3 : body % 2 == 0 ? 1 : 0;
      if (poses == 0) continue;
      plan.units.push_back({fmt::format("test:{} {}", body, name_of(kind)),
                            [subjects = request.subjects, body, kind, poses, recorded] { return find_all(*subjects, body, kind, poses, *recorded); }});
    }
  }
  if (!request.short_form) {
    // The last poses of the five hundred.
    for (int body = 1; body <= 25; ++body)
      for (const PoseKind kind : {PoseKind::lying, PoseKind::crouching})
        plan.units.push_back({fmt::format("test:{} {}, again", body, name_of(kind)),
                              [subjects = request.subjects, body, kind, recorded] { return find_all(*subjects, body + 45, kind, 1, *recorded); }});
  }
  const std::vector<std::pair<int, int>> pairs =
      request.short_form ? std::vector<std::pair<int, int>>{{3, 70}}
                         : std::vector<std::pair<int, int>>{{3, 70}, {70, 3}, {12, 31}, {52, 81}, {8, 44}, {60, 21}, {38, 90}, {25, 5}, {88, 47}, {17, 66}};
  int which = 0;
  for (const auto& [first, second] : pairs) {
    static constexpr const char* kMotions[]{"wave", "walk", "squat", "turn", "kick"};
    const char* motion = kMotions[which++ % 5];
    plan.units.push_back({fmt::format("test:{} after test:{}", second, first),
                          [subjects = request.subjects, first, second, motion] { return reacquire(*subjects, first, second, motion); }});
  }
  for (const PoseKind kind : kPoseKinds) {
    plan.goals.push_back({std::string(name_of(kind)), "booth", "success (joints < 5 cm)", true, 97});
    plan.goals.push_back({std::string(name_of(kind)), "booth", "processor time of a start, one thread", false, 0.5, Goal::Figure::most});  // each of them
  }
  plan.goals.push_back({"another person half a second later", "booth", "scene time until found", false, 0.5, Goal::Figure::most});
  return plan;
}

}  // namespace booth::accuracy

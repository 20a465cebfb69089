// Table speed: what a frame and a start cost, each beside a plain copy of the frame's images in the same run.
#include <fmt/format.h>
#include <time.h>

#include <cstring>

#include "tests/accuracy/booth/motion_run.hpp"
#include "tests/accuracy/booth/poses.hpp"
#include "tests/accuracy/booth/stills.hpp"
#include "tests/accuracy/methods/estimator_method.hpp"
#include "tests/accuracy/tables/tables.hpp"

namespace booth::accuracy {
namespace {

double thread_ms() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

/// Of four depth images, from and to memory that no cache holds.
double copy_ms() {
  constexpr std::size_t kImages = 4 * 512 * 424 * 2, kBuffer = std::size_t{64} << 20;
  static const std::vector<char> from(kBuffer, 1);
  static std::vector<char> to(kBuffer, 2);
  const double begin = thread_ms();
  std::memcpy(to.data(), from.data(), kBuffer);
  return (thread_ms() - begin) * static_cast<double>(kImages) / static_cast<double>(kBuffer);
}

void note(Samples& out, const char* method, const char* what, double ms) {
  record(out, what, method, "processor time, one thread", "ms", ms);
  record(out, what, method, "against a copy of the frame's images", "times", ms / copy_ms());
}

Samples time_tracking(const Subjects& subjects, int body, double seconds) {
  Samples out;
  copy_ms();  // touches the memory
  follow(subjects, subjects.get(body), {"walk", {}}, {.seconds = seconds, .seed = static_cast<std::uint64_t>(body)}, [&](const Sighting& s) {
    if (s.frame > 0 && s.result->state == fit::FitState::tracked) note(out, "booth", "tracked frame, cloud and fit", s.milliseconds);
    return true;
  });
  return out;
}

Samples time_start(const Subjects& subjects, int body) {
  const Subject subject = subjects.get(body);
  Random random(1, static_cast<std::uint64_t>(body));
  const fit::PoseVector truth = anywhere(subject, study_pose(subject, (body - 1) % 3 + 1), 0.2, random);
  const Stills stills = render_stills(subject, {truth}, {}, static_cast<std::uint64_t>(body));
  Booth booth;
  const fit::Observation& observation = booth.look(stills, 0);
  Samples out;
  copy_ms();
  const auto ours = make_estimator(subjects, fit::Preset::booth, fit::SexChoice::automatic);
  double before = thread_ms();
  ours->step(observation);
  note(out, "booth", "start from nothing, fit", thread_ms() - before);
  const auto paper = make_estimator(subjects, fit::Preset::paper, choice_of(subject.sex()));
  const fit::PoseVector start = comparator_start(paper->model(), observation.cloud, truth[4]);
  paper->fit(observation, &start);
  before = thread_ms();
  paper->step(observation);
  note(out, "paper", "frame, swarm of 2,000 x 10", thread_ms() - before);
  return out;
}

}  // namespace

Plan plan_speed(const Request& request) {
  Plan plan;
  plan.protocol =
      "Processor time of one thread, men's and women's models both open in starts of preset `booth`, Kinect v2 noise. The ratio is to a plain copy of a "
      "frame's four depth images, taken beside each "
      "figure: only ratios travel from machine to machine. The paper reports 20.25 frames a second of its swarm on a GTX 1080. `booth-bench` measures the "
      "parts.";
  for (int body = 5; body <= request.subjects->count(); body += request.short_form ? 60 : 12) {
    plan.units.push_back({fmt::format("start test:{}", body), [subjects = request.subjects, body] { return time_start(*subjects, body); }});
    plan.units.push_back({fmt::format("tracking test:{}", body),
                          [subjects = request.subjects, body, s = request.short_form ? 1.0 : 3.0] { return time_tracking(*subjects, body, s); }});
  }
  return plan;
}

}  // namespace booth::accuracy

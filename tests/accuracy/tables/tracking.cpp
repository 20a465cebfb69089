// Table tracking: how closely a person in motion is followed, how long they are ever lost, how still a still person is, and how late the filter is.
#include <fmt/format.h>

#include <cmath>

#include "tests/accuracy/booth/errors.hpp"
#include "tests/accuracy/booth/motion_run.hpp"
#include "tests/accuracy/tables/tables.hpp"

namespace booth::accuracy {
namespace {

constexpr double kFirstSecond = 1.0;  // in which the person has just been found; its frames count like any other, but not for the jitter
constexpr const char* kAll = "all motions";

/// Trial lags of the estimate behind the truth, seconds.
constexpr double kLagStep = 0.005;
constexpr int kLags = 25;

Samples follow_one(const Subjects& subjects, int body, const Clip& clip, double seconds) {
  const Subject subject = subjects.get(body);
  Samples out;
  double lost_since = -1, longest = 0, lag_error[kLags] = {};
  int frames = 0;
  const auto both = [&](const char* metric, const char* unit, double value) {
    record(out, clip.name, "booth", metric, unit, value);
    record(out, kAll, "booth", metric, unit, value);
  };
  follow(subjects, subject, clip, {.seconds = seconds, .seed = static_cast<std::uint64_t>(body), .heading = 0.7 * body}, [&](const Sighting& s) {
    const bool lost = s.result->state == fit::FitState::lost;
    both("frames lost", "percent", lost ? 100 : 0);
    if (lost && lost_since < 0) lost_since = s.time;
    if (!lost) lost_since = -1;
    if (lost) longest = std::max(longest, s.time - lost_since + 1.0 / 30);
    // A lost frame's joints are what would have been published: they count.
    const fit::Points3 truth = subject.joints(s.truth);
    both("15 main joints, mean of a frame", "cm", 100 * main_joint_error(s.result->joints, truth));
    for (const int j : fit::main_joints()) {
      out.at(clip.name, "booth", "each of the 15 main joints", "cm").add(100 * (s.result->joints.col(j) - truth.col(j)).norm());
      out.at(kAll, "booth", "each of the 15 main joints", "cm").add(100 * (s.result->joints.col(j) - truth.col(j)).norm());
    }
    out.at(clip.name, "booth", "each of the 15 main joints", "cm").count();
    out.at(kAll, "booth", "each of the 15 main joints", "cm").count();
    if (!lost && s.time > kFirstSecond) {
      ++frames;
      for (int l = 0; l < kLags; ++l) lag_error[l] += std::pow(main_joint_error(s.result->joints, subject.joints(s.truth_at((5 - l) * kLagStep))), 2);
    }
    return true;
  });
  both("longest loss of a clip", "s", longest);
  if (frames > 20) {
    const int least = static_cast<int>(std::min_element(lag_error, lag_error + kLags) - lag_error);
    both("lag of the filter (shift of the truth that explains it best)", "ms", std::max(0.0, 1000 * (least - 5) * kLagStep));
  }
  return out;
}

/// Somebody who does not move at all: what moves is the estimate.
Samples stand_still(const Subjects& subjects, int body, double seconds) {
  const Subject subject = subjects.get(body);
  Clip still{"at rest", {}};
  const fit::PoseVector q = subject.model->rest_pose();
  still.frames.assign(static_cast<std::size_t>(seconds * 30) + 2, q);
  std::vector<fit::Points3> seen;
  follow(subjects, subject, still, {.seconds = seconds, .seed = static_cast<std::uint64_t>(body), .heading = 0.7 * body}, [&](const Sighting& s) {
    if (s.time > kFirstSecond) seen.push_back(s.result->joints);
    return true;
  });
  Samples out;
  fit::Points3 mean = fit::Points3::Zero();
  for (const auto& p : seen) mean += p / static_cast<double>(seen.size());
  for (const int j : fit::main_joints()) {
    double squares = 0, steps = 0;
    for (std::size_t k = 0; k < seen.size(); ++k) {
      squares += (seen[k].col(j) - mean.col(j)).squaredNorm() / static_cast<double>(seen.size());
      if (k > 0) steps += (seen[k].col(j) - seen[k - 1].col(j)).norm() / static_cast<double>(seen.size() - 1);
    }
    out.at("at rest", "booth", "jitter (sd of a joint's place)", "mm").add(1000 * std::sqrt(squares));
    out.at("at rest", "booth", "step from frame to frame", "mm").add(1000 * steps);
  }
  out.at("at rest", "booth", "jitter (sd of a joint's place)", "mm").count();
  out.at("at rest", "booth", "step from frame to frame", "mm").count();
  return out;
}

}  // namespace

Plan plan_tracking(const Request& request) {
  Plan plan;
  plan.protocol = fmt::format(
      "Preset `booth` follows set-aside bodies through {}, from four free-running cameras with Kinect v2 noise, in the daemon's order of work (`step`), the "
      "first frame from nothing. A lost frame counts with the joints that it reported. Joint errors are against the truth at the group's reference instant. "
      "The lag is the delay of the "
      "truth that fits the estimates best, in steps of 5 ms: what the motion model and the temporal term cost. At rest: a body that does not move, after its "
      "first second.",
      request.data.empty() ? "the project's own motions"
      : request.short_form ? "one recorded motion of each kind that was set aside before training"
                           : "recorded motions that were set aside before training, and own ones of kinds that are missing there");
  const bool recorded = !request.data.empty();
  std::vector<int> bodies{4, 23, 38, 49, 67, 82};
  if (request.short_form) bodies = recorded ? std::vector<int>{4, 49} : std::vector<int>{4};
  const double seconds = !request.short_form ? 12 : recorded ? 4 : 2;
  plan.protocol += fmt::format(" At most {:g} s of a motion; shorter recordings are followed to their end (n counts frames, 30 a second).", seconds);
  std::size_t motion = 0;
  for (const Clip& clip : held_out_clips(request)) {
    if (request.short_form && !recorded && clip.name != "walk" && clip.name != "kick" && clip.name != "roll-hands") continue;
    // Each motion by half of the bodies, one half and the other in turns.
    const std::size_t step = bodies.size() > 1 ? 2 : 1;
    for (std::size_t b = motion++ % step; b < bodies.size(); b += step) {
      const int body = bodies[b];
      plan.units.push_back({fmt::format("{} test:{}", clip.name, body),
                            [subjects = request.subjects, body, clip, seconds] { return follow_one(*subjects, body, clip, seconds); }});
    }
  }
  for (const int body : bodies)
    plan.units.push_back({fmt::format("at rest test:{}", body),
                          [subjects = request.subjects, body, s = request.short_form ? 2.0 : 5.0] { return stand_still(*subjects, body, s); }});
  plan.goals = {{"*", "booth", "15 main joints, mean of a frame", false, 2},
                {"*", "booth", "each of the 15 main joints", false, 4.5, Goal::Figure::p95},
                {"*", "booth", "longest loss of a clip", false, 0.5, Goal::Figure::most},
                {"at rest", "booth", "jitter (sd of a joint's place)", false, 2},
                {"at rest", "booth", "jitter (sd of a joint's place)", false, 2, Goal::Figure::p95}};
  return plan;
}

}  // namespace booth::accuracy

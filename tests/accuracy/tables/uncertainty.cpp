// Table uncertainty: how often the truth lies within the stated covariance, and whether a hidden limb says that it is hidden.
#include <fmt/format.h>

#include <Eigen/Cholesky>

#include "tests/accuracy/booth/errors.hpp"
#include "tests/accuracy/booth/motion_run.hpp"
#include "tests/accuracy/tables/tables.hpp"

namespace booth::accuracy {
namespace {

// Squared Mahalanobis distances that hold 68 % and 95 % of a normal distribution in three dimensions.
constexpr double kSixtyEight = 3.5059, kNinetyFive = 7.8147;

void add(Samples& out, const std::string& case_name, const fit::FitResult& result, const fit::Points3& truth) {
  for (const int j : fit::main_joints()) {
    const auto i = static_cast<std::size_t>(j);
    const Eigen::Vector3d error = result.joints.col(j) - truth.col(j);
    const Eigen::Matrix3d covariance = result.joint_covariance[i];
    const double distance2 = error.dot(covariance.ldlt().solve(error));
    const bool seen = result.visibility[i] == fit::JointVisibility::seen;
    for (const auto& group : {std::string("all joints"), std::string(seen ? "seen joints" : "inferred joints")}) {
      record(out, case_name, "booth", group + ": truth within the stated 68 %", "percent", distance2 <= kSixtyEight ? 100 : 0);
      record(out, case_name, "booth", group + ": truth within the stated 95 %", "percent", distance2 <= kNinetyFive ? 100 : 0);
      record(out, case_name, "booth", group + ": error", "cm", 100 * error.norm());
      record(out, case_name, "booth", group + ": stated deviation", "cm", 100 * std::sqrt(std::max(0.0, covariance.trace())));
    }
    record(out, case_name, "booth", "joints said to be inferred", "percent", seen ? 0 : 100);
  }
}

Samples follow_one(const Subjects& subjects, int body, const Clip& clip, double seconds, unsigned cameras, const std::string& case_name) {
  const Subject subject = subjects.get(body);
  Samples out;
  follow(subjects, subject, clip, {.seconds = seconds, .seed = static_cast<std::uint64_t>(body), .cameras = cameras, .heading = 0.7 * body},
         [&](const Sighting& s) {
           if (s.result->state != fit::FitState::lost) add(out, case_name, *s.result, subject.joints(s.truth));
           return true;
         });
  return out;
}

}  // namespace

Plan plan_uncertainty(const Request& request) {
  Plan plan;
  plan.protocol =
      "Held-out bodies and motions with Kinect v2 noise, as in table tracking. Coverage is the share of joints (the 15 main ones) whose true place lies within "
      "the ellipsoid "
      "that the stated covariance gives for 68 % and 95 %. With one camera (front-left) half of the body is hidden: how many joints are said to be inferred, "
      "and what that is worth.";
  const std::vector<int> bodies = request.short_form ? std::vector<int>{9} : std::vector<int>{9, 27, 42, 55, 73, 86};
  const double seconds = request.short_form ? 2 : 6;
  std::size_t motion = 0;
  for (const Clip& clip : held_out_clips(request)) {
    if (request.short_form && request.data.empty() && clip.name != "walk" && clip.name != "kick") continue;
    // Each motion by a third of the bodies, in turns.
    const std::size_t step = bodies.size() > 1 ? 3 : 1;
    for (std::size_t b = motion++ % step; b < bodies.size(); b += step) {
      const int body = bodies[b];
      for (const auto& [cameras, name] : {std::pair{0xFu, "four cameras"}, {0x1u, "one camera"}})
        plan.units.push_back({fmt::format("{} {} test:{}", name, clip.name, body),
                              [subjects = request.subjects, body, clip, seconds, cameras = cameras, name = std::string(name)] {
                                return follow_one(*subjects, body, clip, seconds, cameras, name);
                              }});
    }
  }
  for (const char* group : {"all joints", "seen joints", "inferred joints"}) {
    plan.goals.push_back({"four cameras", "booth", std::string(group) + ": truth within the stated 68 %", true, 58});
    plan.goals.push_back({"four cameras", "booth", std::string(group) + ": truth within the stated 68 %", false, 78});
    plan.goals.push_back({"four cameras", "booth", std::string(group) + ": truth within the stated 95 %", true, 85});
  }
  return plan;
}

}  // namespace booth::accuracy

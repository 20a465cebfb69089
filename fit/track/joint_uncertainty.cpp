// One constant a joint and one scale, from 40 people in ten motions (docs/design/detail.md).
#include "fit/track/joint_uncertainty.hpp"

#include <algorithm>
#include <array>

namespace booth::fit {
namespace {

// Points near each other are wrong together, so that the curvature, which takes them for independent, says too little where there are many of them and too
// much where it is weak: half its deviation, and the rest is the joint's own.
constexpr double kSeenScale = 0.5;
// A joint that nothing was seen of is known by the priors and by its neighbours alone.
constexpr double kInferredScale = 2, kInferredOwn = 0.06;

/// Metres in every direction, of a joint that was seen; left and right alike, in the order of bones().
constexpr std::array<double, kJoints> kOwn{
    0.0048,                                  // root
    0.0059, 0.0041, 0.0039, 0.0054, 0.0072,  // left hip, knee, ankle, foot, toe
    0.0059, 0.0041, 0.0039, 0.0054, 0.0072,  // right
    0.0050, 0.0032,                          // spine_pivot, chest_top
    0.0042, 0.0038, 0.0058, 0.0054,          // left shoulder, elbow, wrist, hand
    0.0042, 0.0038, 0.0058, 0.0054,          // right
    0.0028, 0.0032, 0.0035,                  // neck_pivot, head_base, head_top
};

struct Spread {
  double scale, own;  ///< factor of the curvature's standard deviation; metres in every direction
};

// Seen from all sides, errors of the two faces of a limb cancel; seen from one, they do not, and depth and girth are told apart by the prior alone.
constexpr double kWhole = 0.8, kOneSide = 0.6, kOneSideOfJoints = 1.4, kOneSideOfShape = 1.6;

/// Of coverage: 0 where the whole surface was seen, 1 where one side of it.
double one_sided(double coverage) { return std::clamp((kWhole - coverage) / (kWhole - kOneSide), 0.0, 1.0); }

Spread spread_of(int joint, JointVisibility visibility, double coverage) {
  if (visibility != JointVisibility::seen) return {kInferredScale, kInferredOwn};
  const double factor = 1 + one_sided(coverage) * (kOneSideOfJoints - 1);
  return {factor * kSeenScale, factor * kOwn[static_cast<std::size_t>(joint)]};
}

}  // namespace

double one_side_factor(double coverage) { return 1 + one_sided(coverage) * (kOneSideOfShape - 1); }

Eigen::Matrix3d calibrated_joint_covariance(const Eigen::Matrix3d& curvature, int joint, JointVisibility visibility, double coverage) {
  const Spread s = spread_of(joint, visibility, coverage);
  return s.scale * s.scale * curvature + s.own * s.own * Eigen::Matrix3d::Identity();
}

Eigen::Matrix3d curvature_of(const Eigen::Matrix3d& calibrated, int joint, JointVisibility visibility, double coverage) {
  const Spread s = spread_of(joint, visibility, coverage);
  return (calibrated - s.own * s.own * Eigen::Matrix3d::Identity()) / (s.scale * s.scale);
}

}  // namespace booth::fit

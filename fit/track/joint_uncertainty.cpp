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
    0.0054,                                  // root
    0.0055, 0.0047, 0.0043, 0.0074, 0.0099,  // left hip, knee, ankle, foot, toe
    0.0055, 0.0047, 0.0043, 0.0074, 0.0099,  // right
    0.0052, 0.0033,                          // spine_pivot, chest_top
    0.0043, 0.0046, 0.0069, 0.0073,          // left shoulder, elbow, wrist, hand
    0.0043, 0.0046, 0.0069, 0.0073,          // right
    0.0025, 0.0040, 0.0035,                  // neck_pivot, head_base, head_top
};

struct Spread {
  double scale, own;  ///< factor of the curvature's standard deviation; metres in every direction
};

// Seen from all sides, errors of the two faces of a limb cancel; seen from one, they do not, and depth and girth are told apart by the prior alone.
constexpr double kWhole = 0.8, kOneSide = 0.6, kOneSideFactor = 1.6;

Spread spread_of(int joint, JointVisibility visibility, double coverage) {
  if (visibility != JointVisibility::seen) return {kInferredScale, kInferredOwn};
  const double factor = one_side_factor(coverage);
  return {factor * kSeenScale, factor * kOwn[static_cast<std::size_t>(joint)]};
}

}  // namespace

double one_side_factor(double coverage) {
  const double unseen = std::clamp((kWhole - coverage) / (kWhole - kOneSide), 0.0, 1.0);
  return 1 + unseen * (kOneSideFactor - 1);
}

Eigen::Matrix3d calibrated_joint_covariance(const Eigen::Matrix3d& curvature, int joint, JointVisibility visibility, double coverage) {
  const Spread s = spread_of(joint, visibility, coverage);
  return s.scale * s.scale * curvature + s.own * s.own * Eigen::Matrix3d::Identity();
}

Eigen::Matrix3d curvature_of(const Eigen::Matrix3d& calibrated, int joint, JointVisibility visibility, double coverage) {
  const Spread s = spread_of(joint, visibility, coverage);
  return (calibrated - s.own * s.own * Eigen::Matrix3d::Identity()) / (s.scale * s.scale);
}

}  // namespace booth::fit

// Two constants a joint and one scale.
#include "fit/track/joint_uncertainty.hpp"

namespace booth::fit {
namespace {

struct Spread {
  double scale, own;  ///< factor of the curvature's standard deviation; metres in every direction
};
constexpr Spread kSeen{1, 0}, kInferred{1, 0};

Spread spread_of(int, JointVisibility visibility) { return visibility == JointVisibility::seen ? kSeen : kInferred; }

}  // namespace

Eigen::Matrix3d calibrated_joint_covariance(const Eigen::Matrix3d& curvature, int joint, JointVisibility visibility) {
  const Spread s = spread_of(joint, visibility);
  return s.scale * s.scale * curvature + s.own * s.own * Eigen::Matrix3d::Identity();
}

Eigen::Matrix3d curvature_of(const Eigen::Matrix3d& calibrated, int joint, JointVisibility visibility) {
  const Spread s = spread_of(joint, visibility);
  return (calibrated - s.own * s.own * Eigen::Matrix3d::Identity()) / (s.scale * s.scale);
}

}  // namespace booth::fit

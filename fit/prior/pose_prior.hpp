// What human poses look like: a PCA subspace of the joint angles, their limits and how fast they change.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "fit/body/skeleton.hpp"

namespace booth::fit {

using PoseAngles = Eigen::Matrix<double, kPoseDofs, 1>;  ///< q[6..35]

/// Contents of pose.npz (docs/reference/model-file.md). Radians, radians per second.
struct PosePrior {
  std::string version;
  PoseAngles mean;
  Eigen::Matrix<double, kPoseDofs, Eigen::Dynamic> components;  ///< 30 x b, orthonormal, 95 % of the variance
  Eigen::VectorXd sigma;                                        ///< b; standard deviation along each component
  PoseAngles standard_deviation;                                ///< of each angle by itself
  PoseAngles lower, upper;                                      ///< soft limits: 1 % and 99 % widened
  Eigen::Matrix<double, kDofs, 1> speed_limit;                  ///< 99 % of |dq/dt|, root included (m/s and rad/s)
  /// 36 x N typical whole poses (cluster medoids of the training frames and their mirrors, lying and crouching ones too) from which a
  /// search may start. Horizontal translation and heading are zero; q[1] is the root's height above the floor for the average skeleton.
  Eigen::Matrix<double, kDofs, Eigen::Dynamic> exemplars;

  /// Throws std::invalid_argument naming the member that is wrong.
  void check() const;
};

/// Sets the joint angles that only `unseen` bones would have told to what is most probable beside the others: the least of outside x squared distance from
/// the subspace + inside x squared Mahalanobis distance inside it, within the limits. Such angles are those that move unseen bones alone, and the turn of a
/// seen thigh or upper arm about its own length where what hangs on it is unseen. Allocates nothing; deterministic on every machine.
void complete_pose(const PosePrior& prior, double outside, double inside, BoneSet unseen, PoseVector& q);

/// Bones of the forearms with their hands and of the shanks with their feet whose elbow or knee is bent by more than 1.2 rad more or less than
/// complete_pose() would bend it. People do that; so does a fit that has no points for a limb and folds it into another's.
BoneSet unusual_limbs(const PosePrior& prior, double outside, double inside, const PoseVector& q);

}  // namespace booth::fit

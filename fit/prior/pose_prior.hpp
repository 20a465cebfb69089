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

/// Sets the joint angles of q whose bit in `unknown` is set (bit k: q[k], root entries are left alone) to what is most probable beside the others: the
/// least of outside x squared distance from the subspace + inside x squared Mahalanobis distance inside it, within the limits. Allocates nothing.
void complete_pose(const PosePrior& prior, double outside, double inside, std::uint64_t unknown, PoseVector& q);

}  // namespace booth::fit

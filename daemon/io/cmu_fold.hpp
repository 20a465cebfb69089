// CMU's full skeleton bends in more places than q does: this finds the 36 angles that put the same joints in the same places.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string_view>

#include "fit/body/skeleton.hpp"

namespace booth::daemon {

/// The bones of an ASF file that move something q knows of. Parents stand before children.
enum class CmuBone : int {
  lfemur,
  ltibia,
  lfoot,
  rfemur,
  rtibia,
  rfoot,
  lowerback,
  upperback,
  thorax,
  lowerneck,
  upperneck,
  head,
  lclavicle,
  lhumerus,
  lradius,
  rclavicle,
  rhumerus,
  rradius,
  count
};
inline constexpr int kCmuBones = static_cast<int>(CmuBone::count);

/// -1 when there is none of this name.
int cmu_bone(std::string_view asf_name);

/// The frame in which an ASF states the bone's angles: C = Z(az) Y(ay) X(ax).
const Eigen::Matrix3d& cmu_axes(int bone);

/// Rotations of a bone with respect to its parent, the identity in the neutral pose: L = C R C^T.
struct CmuPose {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< of the root, metres
  Eigen::Matrix3d root = Eigen::Matrix3d::Identity();
  std::array<Eigen::Matrix3d, kCmuBones> local;  ///< identities where a file says nothing
  CmuPose() { local.fill(Eigen::Matrix3d::Identity()); }
};

/// q on the average skeleton. Root and legs are copied; the 18 angles of the upper body are refined by Levenberg-Marquardt until chest, shoulders,
/// elbows, wrists and head stand where the full skeleton has them. `previous` (may be null) decides which turn of the heading is meant.
fit::PoseVector fold(const CmuPose& pose, const fit::PoseVector* previous);

}  // namespace booth::daemon

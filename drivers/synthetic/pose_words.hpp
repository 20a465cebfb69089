// Poses in words: angles of single joints in degrees, arms of either side.
#pragma once

#include <initializer_list>
#include <numbers>

#include "fit/body/skeleton.hpp"

namespace booth::drivers {

/// One entry of q by its name (docs/reference/skeleton.md).
struct JointAngle {
  const char* dof;
  double degrees;
};

/// The pose with these entries in place of its own.
inline fit::PoseVector with(fit::PoseVector q, std::initializer_list<JointAngle> angles) {
  for (const JointAngle& a : angles) q[fit::dof_index(a.dof)] = a.degrees * (std::numbers::pi / 180);
  return q;
}

/// Degrees, of a left arm; a right one is its mirror image.
struct ArmAngles {
  double rx, ry, rz, elbow;
};

inline fit::PoseVector with_left_arm(const fit::PoseVector& q, const ArmAngles& a) {
  return with(q, {{"lhumerus_rx", a.rx}, {"lhumerus_ry", a.ry}, {"lhumerus_rz", a.rz}, {"lradius_rx", a.elbow}});
}
inline fit::PoseVector with_right_arm(const fit::PoseVector& q, const ArmAngles& a) {
  return with(q, {{"rhumerus_rx", a.rx}, {"rhumerus_ry", -a.ry}, {"rhumerus_rz", -a.rz}, {"rradius_rx", a.elbow}});
}

}  // namespace booth::drivers

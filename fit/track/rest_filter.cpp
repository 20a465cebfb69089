// One share for all unknowns: angles that make up for each other must not be late by different amounts.
#include "fit/track/rest_filter.hpp"

#include <algorithm>

namespace booth::fit {

const PoseVector& RestFilter::next(const PoseVector& q, const Points3& bone_vectors) {
  const PoseVector change = q - pose_;
  double most = change.tail<kDofs - 3>().cwiseAbs().maxCoeff() / kTurn;
  if (has_pose_ && most < 1) {
    Kinematics before, now;
    forward_kinematics(pose_, bone_vectors, before);
    forward_kinematics(q, bone_vectors, now);
    most = std::max(most, (now.joint - before.joint).colwise().norm().maxCoeff() / kMove);
  }
  if (has_pose_ && most < 1)
    pose_ += (kLeast + (1 - kLeast) * most * most) * change;
  else
    pose_ = q;
  has_pose_ = true;
  return pose_;
}

}  // namespace booth::fit

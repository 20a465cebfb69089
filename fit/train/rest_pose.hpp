// The A-pose of the template in CMU angles (q_rest).
#pragma once

#include "fit/body/body_model.hpp"

namespace booth::fit::train {

/// Trunk, neck and head: the mean orientation of people standing at ease in the CMU motions, because an upright mesh is exactly that.
/// Arms, thighs, shanks and toes: least squares on bone directions against the CMU neutral ones, with a small pull to zero for twists.
/// `rest_joints`: of a symmetric mean body. The result is symmetric and has no translation.
PoseVector solve_rest_pose(const Points3& rest_joints);

}  // namespace booth::fit::train

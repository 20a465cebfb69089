// From the curvature at a solution to covariances that hold what they say: least squares knows nothing of the model's own errors.
#pragma once

#include <Eigen/Core>

#include "fit/estimator.hpp"

namespace booth::fit {

/// `curvature`: J (J^T W J)^-1 J^T of a joint, m^2, any frame. Scaled, and widened by what the model, its joint regressor and its skinning are wrong by at
/// this joint; more for a joint that was not seen, and for all of them where little of the body was: `coverage` is the part of the surface that points explain.
/// The constants are set by `booth-uncertainty-study` on people and motions that are not reported on: docs/design/detail.md.
Eigen::Matrix3d calibrated_joint_covariance(const Eigen::Matrix3d& curvature, int joint, JointVisibility visibility, double coverage);
/// The inverse, for calibration.
Eigen::Matrix3d curvature_of(const Eigen::Matrix3d& calibrated, int joint, JointVisibility visibility, double coverage);

/// How much larger deviations of the shape's coefficients are where points explain only the part `coverage` of the surface; at least 1.
double one_side_factor(double coverage);

}  // namespace booth::fit

// Non-negative least squares, which makes joint regressors that cannot point outside the body (eq. 3).
#pragma once

#include <Eigen/Core>

namespace booth::fit::train {

/// Minimises w' gram w / 2 - w' target over w >= 0 (Lawson and Hanson's active set on the normal equations).
/// `gram` is symmetric positive semi-definite, n x n; `target` n x 1.
Eigen::VectorXd solve_nnls(const Eigen::MatrixXd& gram, const Eigen::VectorXd& target);

}  // namespace booth::fit::train

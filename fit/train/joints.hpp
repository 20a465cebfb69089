// Where the 24 joints of the CMU skeleton lie in a base body, and how a mesh's own vertices tell them (eq. 2-3).
#pragma once

#include "fit/body/body_model.hpp"
#include "fit/train/base_body.hpp"

namespace booth::fit::train {

/// Each joint as a fixed linear combination (weights sum to 1) of base vertices; the rules stand in docs/design/priors.md.
/// Throws std::invalid_argument when the base body lacks a point.
std::vector<SparseRow> joint_rows(const BaseBody& base);

struct RegressorInput {
  Vertices mean;  ///< 3 x V
  Points3 mean_joints;
  Eigen::VectorXi mirror_vertex;
  const Eigen::MatrixXf* bodies = nullptr;  ///< (3V + 72) x N: vertices, then joints; may be null for the template alone
};

/// 24 x V rows, >= 0, summing to 1, symmetric between left and right. Neighbours of each joint are taken until they enclose it
/// (the mean body's residual is below 1 mm); without bodies the result is eq. 3 on the mean body alone.
Eigen::MatrixXd train_joint_regressor(const RegressorInput& input);

}  // namespace booth::fit::train

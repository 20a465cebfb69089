// Principal components of many long vectors through their small Gram matrix.
#pragma once

#include <Eigen/Core>

namespace booth::fit::train {

struct Components {
  Eigen::VectorXd variance;   ///< all eigenvalues, descending (divided by the number of samples)
  Eigen::MatrixXf direction;  ///< dimension x kept; unit length, largest entry positive
};

/// `deviations`: dimension x samples with the mean taken off. Keeps at most `most` components whose variance is positive.
Components principal_components(const Eigen::MatrixXf& deviations, int most);

}  // namespace booth::fit::train

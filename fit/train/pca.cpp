// Eigenvectors of X'X (samples x samples) give those of XX' when samples are few and vectors long.
#include "fit/train/pca.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace booth::fit::train {

Components principal_components(const Eigen::MatrixXf& deviations, int most) {
  const Eigen::Index samples = deviations.cols(), dimension = deviations.rows();
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(samples, samples);
  // In slices: double precision without a second copy of everything.
  constexpr Eigen::Index kSlice = 1024;
  for (Eigen::Index start = 0; start < dimension; start += kSlice) {
    const Eigen::MatrixXd slice = deviations.middleRows(start, std::min(kSlice, dimension - start)).cast<double>();
    gram.selfadjointView<Eigen::Lower>().rankUpdate(slice.transpose());
  }
  gram /= static_cast<double>(samples);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(gram);
  Components result;
  result.variance = solver.eigenvalues().reverse().cwiseMax(0);
  const double least = 1e-10 * std::max(result.variance[0], 1e-30);
  Eigen::Index kept = 0;
  while (kept < std::min<Eigen::Index>(most, samples) && result.variance[kept] > least) ++kept;
  const Eigen::MatrixXf mixing = solver.eigenvectors().rowwise().reverse().leftCols(kept).cast<float>();
  result.direction = deviations * mixing;
  for (Eigen::Index k = 0; k < kept; ++k) {
    auto column = result.direction.col(k);
    column.normalize();
    Eigen::Index largest = 0;
    column.cwiseAbs().maxCoeff(&largest);
    if (column[largest] < 0) column = -column;
  }
  return result;
}

}  // namespace booth::fit::train

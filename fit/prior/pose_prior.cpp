// Checks of the pose prior's data, and what it says of angles that nothing was seen of.
#include "fit/prior/pose_prior.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <stdexcept>

namespace booth::fit {

void PosePrior::check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("pose prior: ") + what);
  };
  const auto b = components.cols();
  require(b >= 1 && b <= kPoseDofs, "components must be 30 x b with 1 <= b <= 30");
  require(sigma.size() == b, "sigma must have one entry for each component");
  require(mean.allFinite() && components.allFinite() && sigma.allFinite() && standard_deviation.allFinite() && lower.allFinite() && upper.allFinite() &&
              speed_limit.allFinite(),
          "a value is not finite");
  require(exemplars.cols() >= 1 && exemplars.allFinite(), "there is no exemplar pose, or one is not finite");
  require((sigma.array() > 0).all() && (standard_deviation.array() > 0).all() && (speed_limit.array() > 0).all(), "a deviation or speed is not positive");
  require((lower.array() < upper.array()).all(), "a lower limit is not below its upper limit");
  require((components.transpose() * components - Eigen::MatrixXd::Identity(b, b)).cwiseAbs().maxCoeff() < 1e-4, "components are not orthonormal");
}

void complete_pose(const PosePrior& prior, double outside, double inside, std::uint64_t unknown, PoseVector& q) {
  using Matrix = Eigen::Matrix<double, kPoseDofs, kPoseDofs>;
  Matrix precision = outside * Matrix::Identity();
  for (Eigen::Index k = 0; k < prior.sigma.size(); ++k)
    precision.noalias() += (inside / (prior.sigma[k] * prior.sigma[k]) - outside) * prior.components.col(k) * prior.components.col(k).transpose();
  // Known angles stay: their rows become x = d, and what they contribute to the others' rows goes to the right-hand side.
  PoseAngles d = q.tail<kPoseDofs>() - prior.mean;
  const auto is_unknown = [&](int i) { return (unknown >> (kRootDofs + i) & 1u) != 0; };
  for (int i = 0; i < kPoseDofs; ++i)
    if (is_unknown(i)) d[i] = 0;
  PoseAngles right = -precision * d;
  for (int i = 0; i < kPoseDofs; ++i) {
    if (is_unknown(i)) continue;
    precision.row(i).setZero();
    precision.col(i).setZero();
    precision(i, i) = 1;
    right[i] = 0;
  }
  const PoseAngles found = precision.ldlt().solve(right);
  for (int i = 0; i < kPoseDofs; ++i)
    if (is_unknown(i)) q[kRootDofs + i] = std::clamp(prior.mean[i] + found[i], prior.lower[i], prior.upper[i]);
}

}  // namespace booth::fit

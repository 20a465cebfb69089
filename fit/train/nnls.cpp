// One variable enters the passive set at a time; those that would turn negative leave it again.
#include "fit/train/nnls.hpp"

#include <Eigen/Cholesky>
#include <limits>
#include <vector>

namespace booth::fit::train {

Eigen::VectorXd solve_nnls(const Eigen::MatrixXd& gram, const Eigen::VectorXd& target) {
  const Eigen::Index n = target.size();
  Eigen::VectorXd w = Eigen::VectorXd::Zero(n);
  std::vector<char> passive(static_cast<std::size_t>(n), 0);
  const double tolerance = 1e-12 * std::max(1e-300, gram.diagonal().cwiseAbs().maxCoeff());
  for (Eigen::Index step = 0; step < 3 * n; ++step) {
    const Eigen::VectorXd gradient = target - gram * w;
    Eigen::Index enter = -1;
    for (Eigen::Index i = 0; i < n; ++i)
      if (!passive[static_cast<std::size_t>(i)] && gradient[i] > tolerance && (enter < 0 || gradient[i] > gradient[enter])) enter = i;
    if (enter < 0) break;
    passive[static_cast<std::size_t>(enter)] = 1;
    for (;;) {
      std::vector<Eigen::Index> index;
      for (Eigen::Index i = 0; i < n; ++i)
        if (passive[static_cast<std::size_t>(i)]) index.push_back(i);
      if (index.empty()) break;
      const Eigen::VectorXd solution = Eigen::LDLT<Eigen::MatrixXd>(gram(index, index)).solve(target(index));
      if (solution.minCoeff() > 0) {
        w.setZero();
        for (std::size_t i = 0; i < index.size(); ++i) w[index[i]] = solution[static_cast<Eigen::Index>(i)];
        break;
      }
      double part = 1;
      for (std::size_t i = 0; i < index.size(); ++i)
        if (const double s = solution[static_cast<Eigen::Index>(i)]; s <= 0 && w[index[i]] - s > 0) part = std::min(part, w[index[i]] / (w[index[i]] - s));
      bool left = false;
      for (std::size_t i = 0; i < index.size(); ++i) {
        const Eigen::Index v = index[i];
        const double s = solution[static_cast<Eigen::Index>(i)];
        w[v] += part * (s - w[v]);
        if (s <= 0 && w[v] <= 1e-15) {
          w[v] = 0;
          passive[static_cast<std::size_t>(v)] = 0;
          left = true;
        }
      }
      if (!left) return w;  // no progress is possible in this precision
    }
  }
  return w;
}

}  // namespace booth::fit::train

// Non-negative least squares on problems whose solution is known, and on random ones by their optimality conditions.
#include "fit/train/nnls.hpp"

#include <gtest/gtest.h>

#include "fit/train/random.hpp"

namespace booth::fit::train {
namespace {

TEST(Nnls, FindsAnInteriorSolution) {
  const Eigen::Matrix3d a = (Eigen::Matrix3d() << 2, 1, 0, 0, 3, 1, 1, 0, 4).finished();
  const Eigen::Vector3d x(0.5, 1.5, 2);
  const Eigen::VectorXd w = solve_nnls(a.transpose() * a, a.transpose() * (a * x));
  EXPECT_LT((w - x).norm(), 1e-10);
}

TEST(Nnls, PutsAWeightToZeroThatWouldBeNegative) {
  // min (w0 - 1)^2 + (w0 + w1)^2 over w >= 0: unconstrained (1, -1); with w1 = 0: w0 = 1/2.
  const Eigen::Matrix2d a = (Eigen::Matrix2d() << 1, 0, 1, 1).finished();
  const Eigen::VectorXd w = solve_nnls(a.transpose() * a, a.transpose() * Eigen::Vector2d(1, 0));
  EXPECT_NEAR(w[0], 0.5, 1e-12);
  EXPECT_EQ(w[1], 0);
}

TEST(Nnls, RandomProblemsSatisfyTheOptimalityConditions) {
  Random random(7, 1);
  for (int trial = 0; trial < 50; ++trial) {
    Eigen::MatrixXd a(20, 12);
    Eigen::VectorXd b(20);
    for (double& v : a.reshaped()) v = random.normal();
    for (double& v : b) v = random.normal();
    const Eigen::MatrixXd gram = a.transpose() * a;
    const Eigen::VectorXd target = a.transpose() * b, w = solve_nnls(gram, target), gradient = target - gram * w;
    for (Eigen::Index i = 0; i < w.size(); ++i) {
      EXPECT_GE(w[i], 0);
      EXPECT_LT(gradient[i], 1e-8);
      if (w[i] > 0) {
        EXPECT_NEAR(gradient[i], 0, 1e-8);
      }
    }
  }
}

}  // namespace
}  // namespace booth::fit::train

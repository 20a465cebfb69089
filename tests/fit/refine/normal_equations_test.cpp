// The blocked accumulator against the plain sum in double precision.
#include "fit/refine/normal_equations.hpp"

#include <gtest/gtest.h>

#include "fit/swarm/random.hpp"

namespace booth::fit {
namespace {

float value(int row, int column) { return Random::normal(Random(1, static_cast<std::uint64_t>(row)).words(static_cast<std::uint32_t>(column), 0, 0)); }

class Sums : public testing::TestWithParam<std::pair<int, int>> {};

TEST_P(Sums, MatchThePlainSum) {
  const auto [rows, unknowns] = GetParam();
  NormalEquations equations;
  equations.reset(unknowns);
  Eigen::MatrixXd j(rows, unknowns);
  Eigen::VectorXd r(rows);
  for (int i = 0; i < rows; ++i) {
    float* row = equations.next_row();
    for (int k = 0; k < unknowns; ++k) j(i, k) = static_cast<double>(row[k] = k % 7 == i % 7 ? 0.0f : value(i, k));
    equations.commit(value(i, unknowns));
    r[i] = static_cast<double>(value(i, unknowns));
  }
  EXPECT_LT((equations.hessian() - j.transpose() * j).cwiseAbs().maxCoeff(), 1e-5 * rows + 1e-12);
  EXPECT_LT((equations.gradient() - j.transpose() * r).cwiseAbs().maxCoeff(), 1e-5 * rows + 1e-12);
  EXPECT_NEAR(equations.energy(), r.squaredNorm(), 1e-6 * rows);
}

INSTANTIATE_TEST_SUITE_P(Sizes, Sums,
                         testing::Values(std::pair{0, 36}, std::pair{1, 1}, std::pair{31, 36}, std::pair{32, 51}, std::pair{33, 60},
                                         std::pair{500, kMaxUnknowns}));

TEST(Sums, AddJoinsTwoAccumulators) {
  NormalEquations a, b, both;
  for (auto* e : {&a, &b, &both}) e->reset(5);
  for (int i = 0; i < 50; ++i) {
    for (auto* e : {i < 20 ? &a : &b, &both}) {
      float* row = e->next_row();
      for (int k = 0; k < 5; ++k) row[k] = value(i, k);
      e->commit(1);
    }
  }
  a.add(b);
  EXPECT_LT((a.hessian() - both.hessian()).cwiseAbs().maxCoeff(), 1e-4);
  EXPECT_LT((a.gradient() - both.gradient()).cwiseAbs().maxCoeff(), 1e-4);
}

}  // namespace
}  // namespace booth::fit

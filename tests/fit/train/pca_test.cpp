// Principal components of data that was made from known ones.
#include "fit/train/pca.hpp"

#include <gtest/gtest.h>

#include "fit/train/random.hpp"

namespace booth::fit::train {
namespace {

TEST(PrincipalComponents, RecoverTheDirectionsThatTheDataWasMadeFrom) {
  constexpr int kDimension = 300, kSamples = 80;
  Eigen::MatrixXf direction = Eigen::MatrixXf::Zero(kDimension, 2);
  for (int i = 0; i < kDimension; ++i) direction(i, i % 2) = 1 / std::sqrt(kDimension / 2.0f);
  // Coefficients that are uncorrelated exactly: cosines of different frequency over the samples.
  Eigen::MatrixXf data(kDimension, kSamples);
  for (int s = 0; s < kSamples; ++s) {
    const float turn = 6.2831853f * static_cast<float>(s) / kSamples;
    data.col(s) = 3 * std::sqrt(2.0f) * std::cos(turn) * direction.col(0) + std::sqrt(2.0f) * std::sin(2 * turn) * direction.col(1);
  }
  const auto found = principal_components(data, 10);
  ASSERT_EQ(found.direction.cols(), 2);
  EXPECT_NEAR(found.variance[0], 9, 1e-4);
  EXPECT_NEAR(found.variance[1], 1, 1e-4);
  EXPECT_NEAR(found.variance.tail(kSamples - 2).sum(), 0, 1e-4);
  EXPECT_NEAR(std::abs(found.direction.col(0).dot(direction.col(0))), 1, 1e-5);
  EXPECT_NEAR(std::abs(found.direction.col(1).dot(direction.col(1))), 1, 1e-5);
}

TEST(PrincipalComponents, AreOrthonormalAndSortedOnNoise) {
  Random random(3, 2);
  Eigen::MatrixXf data(200, 30);
  for (float& v : data.reshaped()) v = static_cast<float>(random.normal());
  data.colwise() -= data.rowwise().mean().eval();
  const auto found = principal_components(data, 12);
  ASSERT_EQ(found.direction.cols(), 12);
  EXPECT_LT((found.direction.transpose() * found.direction - Eigen::MatrixXf::Identity(12, 12)).cwiseAbs().maxCoeff(), 1e-5f);
  for (int k = 1; k < 12; ++k) EXPECT_GE(found.variance[k - 1], found.variance[k]);
}

}  // namespace
}  // namespace booth::fit::train

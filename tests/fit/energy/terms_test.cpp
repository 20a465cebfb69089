// Each term of the paper's energy by itself, on cases that can be worked out by hand.
#include "fit/energy/terms.hpp"

#include <gtest/gtest.h>

#include "tests/support/capsule_body.hpp"
#include "tests/support/plain_prior.hpp"

namespace booth::fit {
namespace {

TEST(PointTerm, IsTheDistanceInMillimetresNotItsSquare) {
  EXPECT_NEAR(point_energy({0, 0, 0}, {0.03f, 0, 0.04f}), 50, 1e-4);
  EXPECT_EQ(point_energy({1, 2, 3}, {1, 2, 3}), 0);
}

TEST(PlaneTerm, SeesOnlyWhatIsAlongTheModelsNormal) {
  EXPECT_NEAR(plane_energy({0, 0, 0}, {1, 0, 0}, {-0.03f, 0.5f, 0.04f}), 30, 1e-4);
  EXPECT_NEAR(plane_energy({0, 0, 0}, {0, 0, 1}, {0.2f, 0.1f, 0}), 0, 1e-6);
}

TEST(ShapeTerm, IsTheSquaredMahalanobisDistance) {
  ShapeVector beta(3);
  beta << 1, -2, 2;
  EXPECT_DOUBLE_EQ(shape_energy(beta), 9);
  EXPECT_DOUBLE_EQ(shape_energy(ShapeVector::Zero(5)), 0);
}

TEST(BoneTerm, IsZeroForASymmetricSkeletonAndCountsFourPairs) {
  Points3 v = average_bone_vectors();
  EXPECT_NEAR(bone_energy(v), 0, 1e-9);
  for (const auto& [left, right] : kLimbPairs) {
    EXPECT_EQ(mirror_bone(left), right);
    Points3 longer = v;
    longer.col(left) *= 1 + 0.01 / v.col(left).norm();  // one centimetre
    EXPECT_NEAR(bone_energy(longer), 100, 1e-6) << bones()[left].name;
  }
  v.col(bone_index("lclavicle")) *= 2;  // not a limb
  EXPECT_NEAR(bone_energy(v), 0, 1e-9);
}

TEST(PoseTerm, IsTheDistanceFromTheSubspaceAndIgnoresTheRoot) {
  PosePrior prior = *tests::plain_prior();
  prior.components = Eigen::Matrix<double, kPoseDofs, kPoseDofs>::Identity().leftCols(20).eval();
  prior.sigma = Eigen::VectorXd::Ones(20);
  PoseVector q;
  q << Eigen::Matrix<double, 6, 1>::Constant(9), prior.mean;
  EXPECT_NEAR(pose_energy(prior, q), 0, 1e-12);
  q[kRootDofs + 3] += 1.5;  // inside the subspace: free, however far
  EXPECT_NEAR(pose_energy(prior, q), 0, 1e-12);
  q[kRootDofs + 25] += 0.2;  // outside
  EXPECT_NEAR(pose_energy(prior, q), 0.04, 1e-12);
}

TEST(PaperWeights, AreThoseOfTheText) {
  constexpr PaperWeights w;
  EXPECT_EQ(w.point, 1);
  EXPECT_EQ(w.plane, 3);
  EXPECT_EQ(w.shape, 1e3);
  EXPECT_EQ(w.bone, 0.03);
  EXPECT_EQ(w.pose, 10);
}

}  // namespace
}  // namespace booth::fit

// Covariances say more of what was seen than of what was not.
#include "fit/track/joint_uncertainty.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "tests/support/capsule_body.hpp"
#include "tests/support/plain_prior.hpp"
#include "tests/support/posed_cloud.hpp"

namespace booth::fit {
namespace {

TEST(JointUncertainty, HasAnInverseAndIsWiderForWhatWasNotSeen) {
  Eigen::Matrix3d curvature;
  curvature << 4e-5, 1e-5, 0, 1e-5, 9e-5, 0, 0, 0, 1e-6;
  for (int j = 0; j < kJoints; ++j) {
    const Eigen::Matrix3d seen = calibrated_joint_covariance(curvature, j, JointVisibility::seen, 0.9);
    const Eigen::Matrix3d inferred = calibrated_joint_covariance(curvature, j, JointVisibility::inferred, 0.9);
    EXPECT_LT((curvature_of(seen, j, JointVisibility::seen, 0.9) - curvature).norm(), 1e-12);
    EXPECT_LT((curvature_of(inferred, j, JointVisibility::inferred, 0.9) - curvature).norm(), 1e-12);
    EXPECT_GT((Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(inferred - seen).eigenvalues().minCoeff()), 0) << "in every direction";
    EXPECT_GT(calibrated_joint_covariance(curvature, j, JointVisibility::seen, 0.5).trace(), 1.5 * seen.trace()) << "from one side less is known";
  }
}

TEST(JointUncertainty, WhatOneSideShowsOfTheShapeIsTakenForLess) {
  EXPECT_EQ(one_side_factor(1), 1);
  EXPECT_EQ(one_side_factor(0.8), 1);
  EXPECT_NEAR(one_side_factor(0.7), 1.3, 1e-12);
  EXPECT_NEAR(one_side_factor(0), one_side_factor(0.6), 1e-12);
  EXPECT_GT(one_side_factor(0), 1.5);
}

TEST(JointUncertainty, AHiddenArmSaysSo) {
  const auto model = tests::capsule_body();
  const PoseVector q = tests::pose_with({{"lhumerus_rz", 50}, {"rhumerus_rz", -50}});
  const ShapeVector beta = ShapeVector::Zero(tests::kCapsuleShapes);
  const Observation whole = tests::posed_cloud(*model, beta, q);
  Vertices posed;
  model->posed(beta, q, posed);
  Observation hidden(whole.cloud.size);
  for (int v = 0; v < model->vertex_count(); ++v) {
    const std::string_view bone = bones()[model->data().skin_bone(0, v)].name;
    if (bone == "rhumerus" || bone == "rradius" || bone == "rhand") continue;
    Vertices one = posed.col(v);
    for (int i = 0; i < whole.cloud.size; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if ((Eigen::Vector3f(whole.cloud.x[k], whole.cloud.y[k], whole.cloud.z[k]) - one.col(0)).norm() > 1e-5f) continue;
      hidden.cloud.push(one.col(0), {whole.cloud.nx[k], whole.cloud.ny[k], whole.cloud.nz[k]}, 0);
      break;
    }
  }
  ASSERT_LT(hidden.cloud.size, whole.cloud.size - 40);
  Estimator estimator(model, nullptr, tests::plain_prior(), {.sex = SexChoice::men});
  const FitResult& result = estimator.fit(hidden, &q);
  const auto spread = [&](const char* joint) { return std::sqrt(result.joint_covariance[static_cast<std::size_t>(joint_index(joint))].trace()); };
  const auto visible = [&](const char* joint) { return result.visibility[static_cast<std::size_t>(joint_index(joint))] == JointVisibility::seen; };
  ASSERT_NE(result.state, FitState::lost);
  EXPECT_TRUE(visible("lwrist"));
  EXPECT_FALSE(visible("rwrist"));
  EXPECT_GT(spread("rwrist"), 2 * spread("lwrist"));
  EXPECT_EQ(result.shape_covariance.rows(), result.beta.size());
}

}  // namespace
}  // namespace booth::fit

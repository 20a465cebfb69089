// The pose prior of invented motions: symmetric, inside its own limits, and with as many components as the motion has.
#include "fit/train/pose_training.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace booth::fit::train {
namespace {

/// Two independent motions: a left knee that swings and a trunk that bends.
Eigen::MatrixXf invented() {
  Eigen::MatrixXf q = Eigen::MatrixXf::Zero(kDofs, 2000);
  for (int f = 0; f < q.cols(); ++f) {
    const float t = static_cast<float>(f) / 30;
    q(1, f) = 0.95f;
    q(dof_index("ltibia_rx"), f) = 0.6f + 0.6f * std::sin(2 * t);
    q(dof_index("upperback_rx"), f) = 0.3f * std::sin(3.1f * t);
  }
  return q;
}

TEST(PoseTraining, FindsTheDegreesOfFreedomThatMove) {
  const auto prior = train_pose_prior(invented(), {{0, 2000, 1}}, {});
  EXPECT_EQ(prior.components.cols(), 3);  // both knees after mirroring, and the trunk
  for (int d = kRootDofs; d < kDofs; ++d) {
    const double reach = prior.components.row(d - kRootDofs).norm();
    const bool moves = d == dof_index("ltibia_rx") || d == dof_index("rtibia_rx") || d == dof_index("upperback_rx");
    EXPECT_NEAR(reach, moves ? 1 : 0, 1e-6) << dof_name(d);
  }
}

TEST(PoseTraining, IsSymmetric) {
  const auto prior = train_pose_prior(invented(), {{0, 2000, 1}}, {});
  PoseVector mean = PoseVector::Zero(), low = PoseVector::Zero(), high = PoseVector::Zero();
  mean.tail<kPoseDofs>() = prior.mean;
  low.tail<kPoseDofs>() = prior.lower;
  high.tail<kPoseDofs>() = prior.upper;
  EXPECT_LT((mirror(mean) - mean).norm(), 1e-6);
  const PoseVector a = mirror(low), b = mirror(high);
  for (int d = kRootDofs; d < kDofs; ++d) {
    EXPECT_NEAR(std::min(a[d], b[d]), low[d], 1e-3) << dof_name(d);
    EXPECT_NEAR(std::max(a[d], b[d]), high[d], 1e-3) << dof_name(d);
  }
}

TEST(PoseTraining, SpeedIsNotTakenAcrossSegments) {
  Eigen::MatrixXf q = invented();
  q.rightCols(1000).row(dof_index("head_ry")).setConstant(1);  // a jump between the segments, none within
  const auto prior = train_pose_prior(q, {{0, 1000, 1}, {1000, 1000, 1}}, {});
  EXPECT_LT(prior.speed_limit[dof_index("head_ry")], 0.2);
  EXPECT_GT(prior.speed_limit[dof_index("ltibia_rx")], 1.0);
}

TEST(PoseTraining, TooLittleIsRefused) {
  EXPECT_THROW(train_pose_prior(invented(), {{0, 500, 1}}, {}), std::invalid_argument);
  EXPECT_THROW(train_pose_prior(invented(), {{1900, 500, 1}}, {}), std::invalid_argument);
}

TEST(PoseTraining, TheLowestJointStandsTwoCentimetresAboveTheFloor) {
  Kinematics kin;
  PoseVector q = PoseVector::Zero();
  q[27] = 1.5;
  forward_kinematics(on_the_floor(q), average_bone_vectors(), kin);
  EXPECT_NEAR(kin.joint.row(1).minCoeff(), 0.02, 1e-9);
}

}  // namespace
}  // namespace booth::fit::train

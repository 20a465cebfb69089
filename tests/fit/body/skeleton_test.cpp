// Forward kinematics against an independent implementation's results, the mirror, and the angles they are made of.
#include "fit/body/skeleton.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "fit/body/exact_math.hpp"

namespace booth::fit {
namespace {

struct Row {
  PoseVector q;
  Points3 joints;
};

/// The fixture: 36 angles, then x, y, z of the joints in its own order; row 1 is q = 0, the others turn one angle by 0.5 rad.
std::vector<Row> read_fixture() {
  std::ifstream in(std::string(BOOTH_SOURCE_DIR) + "/tests/fit/body/fk_check.csv");
  std::string line, cell;
  std::vector<std::string> names;
  std::getline(in, line);
  for (std::istringstream words(line); std::getline(words, cell, ',');) names.push_back(cell);
  std::vector<Row> rows;
  while (std::getline(in, line)) {
    Row row;
    row.joints.setConstant(1e9);
    std::istringstream words(line);
    for (std::size_t i = 0; i < names.size() && std::getline(words, cell, ','); ++i) {
      const double value = std::stod(cell);
      if (i < kDofs) {
        row.q[static_cast<Eigen::Index>(i)] = value;
      } else {
        const int joint = joint_index(names[i].substr(0, names[i].size() - 2));
        EXPECT_GE(joint, 0) << names[i];
        row.joints(names[i].back() - 'x', joint) = value;
      }
    }
    rows.push_back(row);
  }
  return rows;
}

TEST(Skeleton, ForwardKinematicsReproducesTheReference) {
  const auto rows = read_fixture();
  ASSERT_EQ(rows.size(), 13u);
  for (const auto& row : rows) {
    Kinematics kin;
    forward_kinematics(row.q, average_bone_vectors(), kin);
    EXPECT_LT((kin.joint - row.joints).cwiseAbs().maxCoeff(), 5e-6) << row.q.transpose();
  }
}

TEST(Skeleton, ATurnAboutItsLengthMovesOnlyWhatHangsOnABone) {
  PoseVector q = PoseVector::Zero();
  for (int k = kRootDofs; k < kDofs; ++k) q[k] = 0.3 * std::sin(k * 1.7);
  for (const int bone : {2, 7, 14, 18}) {
    q[bones()[static_cast<std::size_t>(bone) + 1].dof[0]] = 1.2;  // a bent knee or elbow
    PoseVector turned = q;
    turn_about_length(bone, 0.5, turned);
    Kinematics before, after;
    forward_kinematics(q, average_bone_vectors(), before);
    forward_kinematics(turned, average_bone_vectors(), after);
    for (int b = 0; b < kBones; ++b) {
      const double moved = (after.joint.col(b) - before.joint.col(b)).norm();
      const bool hangs_on_it = (dof_mask(b) >> bones()[static_cast<std::size_t>(bone) + 1].dof[0] & 1u) != 0;
      EXPECT_EQ(moved > 0.05, hangs_on_it) << b << " moved " << moved;
      EXPECT_TRUE(hangs_on_it || moved < 1e-5) << b << " moved " << moved;
    }
    // By the angle that was asked for, and back again.
    const Eigen::Matrix3d turn = after.rotation[static_cast<std::size_t>(bone)] * before.rotation[static_cast<std::size_t>(bone)].transpose();
    EXPECT_NEAR((turn.trace() - 1) / 2, std::cos(0.5), 1e-9);
    turn_about_length(bone, -0.5, turned);
    EXPECT_LT((turned - q).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(Skeleton, EachFixtureRowTurnsAtMostOneAngle) {
  for (const auto& row : read_fixture()) EXPECT_LE((row.q.array() != 0).count(), 1);
}

TEST(Skeleton, MirrorIsAnInvolutionThatReflectsTheJoints) {
  PoseVector q;
  for (int i = 0; i < kDofs; ++i) q[i] = 0.3 * std::sin(1.7 * i + 0.4);
  EXPECT_EQ(mirror(mirror(q)), q);
  Kinematics a, b;
  forward_kinematics(q, average_bone_vectors(), a);
  forward_kinematics(mirror(q), average_bone_vectors(), b);
  for (int j = 0; j < kJoints; ++j) {
    const Eigen::Vector3d p = a.joint.col(j);
    EXPECT_LT((Eigen::Vector3d(-p.x(), p.y(), p.z()) - b.joint.col(mirror_bone(j))).norm(), 1e-5) << bones()[j].end_joint;
  }
}

TEST(Skeleton, KneesBendBackwardsAndElbowsForwards) {
  Kinematics neutral, bent;
  PoseVector q = PoseVector::Zero();
  q[26] = -20 * 3.14159265358979 / 180;  // left thigh hangs
  q[13] = 75 * 3.14159265358979 / 180;   // left arm hangs
  forward_kinematics(q, average_bone_vectors(), neutral);
  q[27] = 1;
  q[14] = 1;
  forward_kinematics(q, average_bone_vectors(), bent);
  const int ankle = joint_index("lankle"), wrist = joint_index("lwrist");
  EXPECT_LT(bent.joint(2, ankle), neutral.joint(2, ankle) - 0.2);
  EXPECT_GT(bent.joint(1, ankle), neutral.joint(1, ankle) + 0.1);
  EXPECT_GT(bent.joint(1, wrist), neutral.joint(1, wrist) + 0.05);
}

TEST(ExactMath, AnAngleComesBackFromItsSineAndCosine) {
  for (int k = -180; k <= 180; ++k) {
    const double angle = k * std::numbers::pi / 180;
    const SinCos at = exact_sincos(angle);
    const double back = exact_angle(at.sin, at.cos);
    EXPECT_NEAR(std::remainder(back - angle, 2 * std::numbers::pi), 0, 1e-14) << k;
  }
}

}  // namespace
}  // namespace booth::fit

// What the prior says of angles that nothing was seen of: against an exhaustive search, in a mirror, and that what was seen stays where it is.
#include "fit/prior/pose_prior.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>
#include <string>

#include "daemon/io/model_file.hpp"

namespace booth::fit {
namespace {

constexpr double kOutside = 25, kInside = 0.3;  // as in RefineWeights

const PosePrior& prior() {
  static const PosePrior p = daemon::load_pose_prior(daemon::find_models() / "pose.npz");
  return p;
}

double asked(const PoseVector& q) {
  const PoseAngles d = q.tail<kPoseDofs>() - prior().mean;
  const Eigen::VectorXd w = prior().components.transpose() * d;
  return kOutside * (d - prior().components * w).squaredNorm() + kInside * (w.array() / prior().sigma.array()).square().sum();
}

PoseVector completed(PoseVector q, BoneSet unseen) {
  complete_pose(prior(), kOutside, kInside, unseen, q);
  return q;
}

Points3 joints_of(const PoseVector& q) {
  Kinematics kin;
  forward_kinematics(q, average_bone_vectors(), kin);
  return kin.joint;
}

bool within_limits(const PoseVector& q, int dof) { return q[dof] >= prior().lower[dof - kRootDofs] && q[dof] <= prior().upper[dof - kRootDofs]; }

constexpr BoneSet set_of(std::initializer_list<int> list) {
  BoneSet out = 0;
  for (const int b : list) out |= BoneSet{1} << b;
  return out;
}
constexpr BoneSet kRightForearm = set_of({19, 20}), kLeftForearm = set_of({15, 16}), kLeftShankAndFoot = set_of({3, 4, 5}), kRightArm = set_of({18, 19, 20});

TEST(CompletePose, WhatWasSeenStaysWhereItIs) {
  for (Eigen::Index e = 0; e < prior().exemplars.cols(); e += 7) {
    const PoseVector before = prior().exemplars.col(e);
    for (const BoneSet unseen : {BoneSet{0}, kRightForearm, kLeftShankAndFoot, kRightArm, kRightForearm | kLeftShankAndFoot}) {
      const PoseVector after = completed(before, unseen);
      const Points3 moved = joints_of(after) - joints_of(before);
      for (int b = 0; b < kBones; ++b) {
        const bool seen = (unseen >> b & 1u) == 0;
        EXPECT_TRUE(!seen || moved.col(b).norm() < 1e-5)
            << "exemplar " << e << ", " << bones()[static_cast<std::size_t>(b)].name << ": " << moved.col(b).norm();
      }
      EXPECT_TRUE(unseen != 0 || after == before);
    }
  }
}

TEST(CompletePose, AForearmIsWhereAnExhaustiveSearchPutsIt) {
  const int elbow = dof_index("rradius_rx");
  for (Eigen::Index e = 0; e < prior().exemplars.cols(); e += 11) {
    const PoseVector before = prior().exemplars.col(e);
    PoseVector folded = before;  // as a fit leaves it that had no points for it
    folded[elbow] = 2.9;
    double least = std::numeric_limits<double>::max();
    for (int t = 0; t < 720; ++t) {
      PoseVector q = before;
      if (t > 0) turn_about_length(18, t * std::numbers::pi / 360, q);
      if (t > 0 && !(within_limits(q, 17) && within_limits(q, 18) && within_limits(q, 19))) continue;
      for (q[elbow] = prior().lower[elbow - kRootDofs]; within_limits(q, elbow); q[elbow] += 0.02) least = std::min(least, asked(q));
    }
    const double found = asked(completed(folded, kRightForearm));
    EXPECT_LT(found, 1.03 * least + 0.3) << "exemplar " << e << ": 15 degrees apart";
    EXPECT_LE(found, asked(before) + 1e-9) << "exemplar " << e;
  }
}

TEST(CompletePose, AMirrorMakesNoDifference) {
  for (Eigen::Index e = 0; e < prior().exemplars.cols(); e += 7) {
    const PoseVector q = prior().exemplars.col(e);
    const double right = asked(completed(q, kRightForearm)), left = asked(completed(mirror(q), kLeftForearm));
    EXPECT_NEAR(right, left, 0.02 * right + 0.05) << "exemplar " << e << ": the prior's own mirror is no better";
  }
}

TEST(CompletePose, AnglesStayWithinTheirLimits) {
  PoseVector q = PoseVector::Zero();
  q[dof_index("rhumerus_rx")] = 3;  // far from all that people do
  const PoseVector out = completed(q, kRightForearm);
  EXPECT_TRUE(within_limits(out, dof_index("rradius_rx")));
}

}  // namespace
}  // namespace booth::fit

// The frames of a body: whole in every pose, and nothing of them when a number is none.
#include "daemon/dds/ros2/body_frames.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "tests/daemon/dds/ros2/expectations.hpp"

namespace booth::daemon {
namespace {

BodyPose pose_of(const FrameRecord& frame) { return {frame.joints, frame.rotation}; }

TEST(BodyFrames, AreDifferentAndComplete) {
  std::set<std::string> names;
  std::set<int> joints, bones;
  for (const BodyFrame& f : body_frames()) {
    ASSERT_GE(f.joint, 0) << f.link;
    ASSERT_GE(f.bone, 0) << f.link;
    names.insert(f.link);
    joints.insert(f.joint);
    bones.insert(f.bone);
  }
  EXPECT_EQ(names.size(), body_frames().size());
  EXPECT_EQ(joints.size(), 23u) << "every joint but the root, whose place is the body's own frame";
  // Bones that do not turn against their parents (hip joints, fixed parts, hands, toes) need no frame of their own; every one that does has one.
  for (const int turning : {2, 3, 4, 7, 8, 9, 12, 13, 14, 15, 17, 18, 19, 22, 23}) EXPECT_TRUE(bones.contains(turning)) << turning;
}

TEST(BodyFrames, ATurnedBodyKeepsItsLinksInItsOwnFrame) {
  const FrameRecord frame = tests::posed_frame();
  FrameRecord turned = frame;
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(2.5, Eigen::Vector3d(0.2, -0.4, 1).normalized()));
  const Eigen::Vector3d shift(1, -2, 0.3);
  for (std::size_t j = 0; j < kRecordJoints; ++j) {
    Eigen::Map<Eigen::Vector3d>(turned.joints[j].data()) = turn * Eigen::Vector3d(frame.joints[j].data()) + shift;
    const Eigen::Quaterniond q = turn * bone_rotation(pose_of(frame), static_cast<int>(j));
    turned.rotation[j] = {static_cast<float>(q.x()), static_cast<float>(q.y()), static_cast<float>(q.z()), static_cast<float>(q.w())};
  }
  const FramePose a = body_frame(pose_of(frame)), b = body_frame(pose_of(turned));
  EXPECT_NEAR((b.translation - (turn * a.translation + shift)).norm(), 0, 1e-12);
  for (const BodyFrame& f : body_frames()) {
    const FramePose x = link_frame(pose_of(frame), a, f), y = link_frame(pose_of(turned), b, f);
    EXPECT_NEAR((x.translation - y.translation).norm(), 0, 1e-6) << f.link;
    EXPECT_LT(x.rotation.angularDistance(y.rotation), 1e-6) << f.link;
  }
}

TEST(BodyFrames, NoRotationIsTheIdentity) {
  const BodyPose nothing;
  EXPECT_EQ(bone_rotation(nothing, 3).w(), 1);
  EXPECT_TRUE(is_finite(nothing));
}

TEST(BodyFrames, WhatIsNoNumberIsSeen) {
  BodyPose pose = pose_of(tests::posed_frame());
  EXPECT_TRUE(is_finite(pose));
  pose.joints[5][1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(is_finite(pose));
  pose = pose_of(tests::posed_frame());
  pose.rotation[23][3] = std::numeric_limits<float>::infinity();
  EXPECT_FALSE(is_finite(pose));
}

}  // namespace
}  // namespace booth::daemon

// Which coordinate frames ROS 2 is told of a body, and where they are (REP-103, REP-155).
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>

#include "daemon/pipeline/frame_record.hpp"
#include "hal/depth_frame.hpp"

namespace booth::daemon {

/// x_parent = rotation * x_child + translation; metres.
struct FramePose {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
};

/// What of a FrameRecord a body's frames are made from; plain values.
struct BodyPose {
  std::array<std::array<double, 3>, kRecordJoints> joints{};   ///< booth frame, m
  std::array<std::array<float, 4>, kRecordJoints> rotation{};  ///< x y z w, of the bone that ends in the joint
};

/// A frame of the body: its origin is a joint, its axes are those of a bone, which in the T-pose are the booth's (x forward, y left, z up).
struct BodyFrame {
  const char* link;  ///< REP-155's name where it has one
  int joint, bone;   ///< indices of docs/reference/skeleton.md
};
inline constexpr int kBodyFrames = 25;
/// All but the body's own, which is their parent.
const std::array<BodyFrame, kBodyFrames>& body_frames();

/// Of a bone, booth frame; a unit. A rotation that is none (all zero) counts as the identity.
Eigen::Quaterniond bone_rotation(const BodyPose& pose, int bone);
/// The body's own frame in the booth's: origin midway between the hips, x forward, z to the head (REP-155).
FramePose body_frame(const BodyPose& pose);
/// A frame of the body in body_frame(). Neither allocates.
FramePose link_frame(const BodyPose& pose, const FramePose& body, const BodyFrame& frame);

/// A camera's optical frame (z forward, x right, y down) in the booth's.
FramePose camera_frame(const hal::RigidTransform& camera_to_world);

/// False where a number of it is none: nothing of that may be told.
bool is_finite(const BodyPose& pose);

}  // namespace booth::daemon

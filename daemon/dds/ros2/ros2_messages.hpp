// A booth's ROS 2 messages with all the memory they ever need, filled in place.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "daemon/dds/ros2/body_frames.hpp"
#include "daemon/dds/ros2/ros_names.hpp"
#include "fit/body/skeleton.hpp"
#include "fit/cloud/observation.hpp"
#include "hal/depth_frame.hpp"
#include "ros2_messages.h"

namespace booth::daemon {

/// One frame as the mirror needs it.
struct Ros2Frame {
  bool present = false;  ///< somebody is there, and what follows means something
  std::int64_t captured_utc_ns = 0;
  BodyPose pose;
  std::array<double, fit::kPoseDofs> angles{};  ///< q[6..35], rad
};

/// Points in the booth frame, metres, x y z one after the other.
struct Ros2Cloud {
  static constexpr int kMostPoints = 4096;
  std::int64_t captured_utc_ns = 0;
  int size = 0;
  std::array<float, std::size_t{3} * kMostPoints> xyz{};

  /// At most kMostPoints of them, evenly among all: always the same ones of the same cloud.
  void take(const fit::Cloud& cloud);
};

/// Members are ready to be written after the function that fills them. One thread. Only the constructor allocates; nothing may be moved.
class Ros2Messages {
 public:
  Ros2Messages(const RosNames& names, const std::vector<hal::CameraDescription>& cameras);
  Ros2Messages(const Ros2Messages&) = delete;

  /// tf, joint_states, joints.
  void fill(const Ros2Frame& frame);
  /// `cloud` is referred to until the next call.
  void fill(const Ros2Cloud& cloud);
  void fill_tracked(bool present, std::int64_t utc_ns);

  tf2_msgs_msg_dds__TFMessage_ tf{}, tf_static{};
  sensor_msgs_msg_dds__JointState_ joint_states{};
  geometry_msgs_msg_dds__PoseArray_ joints{};
  sensor_msgs_msg_dds__PointCloud2_ cloud{};
  hri_msgs_msg_dds__IdsList_ tracked{};

 private:
  /// Lives as long as the messages that point to it.
  char* keep(std::string text);

  std::vector<std::unique_ptr<char[]>> texts_;
  std::array<geometry_msgs_msg_dds__TransformStamped_, kBodyFrames + 1> transforms_{};
  std::vector<geometry_msgs_msg_dds__TransformStamped_> cameras_;
  std::array<char*, fit::kPoseDofs> angle_names_{};
  std::array<double, fit::kPoseDofs> angles_{};
  std::array<geometry_msgs_msg_dds__Pose_, kRecordJoints> poses_{};
  std::array<sensor_msgs_msg_dds__PointField_, 3> fields_{};
  std::array<char*, 1> ids_{};
};

}  // namespace booth::daemon

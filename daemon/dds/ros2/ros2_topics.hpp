// The ROS 2 topics of a booth: type, hash of the type and quality of service of each; the reasons are in docs/reference/ros2.md.
#pragma once

#include <dds/dds.h>

#include <array>
#include <cstdint>
#include <string>

#include "daemon/dds/ros2/ros_names.hpp"

namespace booth::daemon {

enum class Ros2Topic : std::uint8_t { tracked, joint_states, tf, tf_static, joints, cloud };
inline constexpr int kRos2Topics = 6;

struct Ros2TopicInfo {
  const char* ros_type;                ///< as ROS 2 writes it: sensor_msgs/msg/JointState
  const char* hash;                    ///< RIHS01_ and 64 digits (REP-2011): which type this is, for ROS 2 Iron and later
  const dds_topic_descriptor_t* type;  ///< DDS's name of it and its layout
  int depth;                           ///< samples that wait for a slow reader
  bool latched;                        ///< late joiners get the last sample (transient local)
};
const Ros2TopicInfo& ros2_topic_info(Ros2Topic topic);

/// As ROS 2 names it, "/tf".
std::string ros2_topic_name(Ros2Topic topic, const RosNames& names);

/// A writer of the topic (on DDS "rt" and its name) with its quality of service and, in USER_DATA, its hash. `publisher` must be in no partition: ROS 2
/// knows none. Throws as dds_check().
dds_entity_t make_ros2_writer(dds_entity_t participant, dds_entity_t publisher, Ros2Topic topic, const RosNames& names);

}  // namespace booth::daemon

// ROS 2's hash of a type (REP-2011, RIHS01), computed from plain IDL as daemon/dds/idl/ros2 is written in.
#pragma once

#include <map>
#include <string>

namespace booth::tests {

/// "sensor_msgs/msg/JointState" -> "RIHS01_a13e...", for each struct of the text. Throws std::runtime_error where it cannot read a line. Needs sha256sum.
std::map<std::string, std::string> rihs01_of_idl(const std::string& idl);

}  // namespace booth::tests

// The ROS 2 mirror: is it on, and how does a node find it.
#include <fmt/format.h>

#include "daemon/dds/ros2/ros_names.hpp"
#include "daemon/health/checks.hpp"

namespace booth::daemon {

Checks check_ros2(const DoctorInputs& in) {
  const auto& dds = in.config.dds;
  if (!dds.enabled || !dds.ros2) return {{"dds", "ros2", CheckResult::skipped, "the ROS 2 mirror is off (dds.ros2 is false)"}};
  const RosNames names(in.config.booth.id, dds.ros2_namespace);
  const std::string seen = fmt::format("on: {}, {}, /tf, /tf_static; ROS_DOMAIN_ID={}", names.tracked, names.body_topic("*"), dds.domain);
  // Above, ports of DDS meet those that Linux gives to any program.
  constexpr std::int64_t kLastSafeDomain = 101;
  if (dds.domain > kLastSafeDomain)
    return {{"dds", "ros2", CheckResult::warning, seen, fmt::format("ROS 2 on Linux is safe in domains 0 to {} only: set dds.domain", kLastSafeDomain)}};
  return {{"dds", "ros2", CheckResult::ok, seen}};
}

}  // namespace booth::daemon

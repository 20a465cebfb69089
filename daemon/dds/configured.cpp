// Keys dds.* and booth.id.
#include "daemon/dds/configured.hpp"

namespace booth::daemon {

DdsSettings dds_settings(const Config& config) {
  return {.booth = config.booth.id,
          .domain = static_cast<std::uint32_t>(config.dds.domain),
          .interface = config.dds.interface,
          .multicast = config.dds.multicast,
          .peers = config.dds.peers};
}

std::optional<Ros2Settings> ros2_settings(const Config& config, const hal::DepthCameras& cameras) {
  if (!config.dds.ros2) return std::nullopt;
  Ros2Settings out{.name_space = config.dds.ros2_namespace};
  for (const auto& camera : cameras) out.cameras.push_back(camera->description());
  return out;
}

}  // namespace booth::daemon

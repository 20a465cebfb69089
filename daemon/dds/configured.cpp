// Keys dds.* and booth.id.
#include "daemon/dds/configured.hpp"

#include <cstdlib>

namespace booth::daemon {

DdsSettings dds_settings(const Config& config) {
  return {.booth = config.booth.id,
          .domain = static_cast<std::uint32_t>(config.dds.domain),
          .interface = config.dds.interface,
          .multicast = config.dds.multicast,
          .peers = config.dds.peers,
          .secured = config.dds.security == "on"};
}

std::optional<Credentials> dds_credentials(const Config& config, Role role, bool may_issue) {
  if (config.dds.security != "on") return std::nullopt;
  const char* delivered = std::getenv("CREDENTIALS_DIRECTORY");
  return obtain_credentials({.role = role,
                             .name = role == Role::booth ? config.booth.id : "",
                             .folder = config.dds.credentials,
                             .delivered = role == Role::booth && delivered ? delivered : "",
                             .self_issued = config.dds.self_issued,
                             .may_issue = may_issue},
                            utc_seconds());
}

std::optional<Ros2Settings> ros2_settings(const Config& config, const hal::DepthCameras& cameras) {
  if (!config.dds.ros2) return std::nullopt;
  Ros2Settings out{.name_space = config.dds.ros2_namespace};
  for (const auto& camera : cameras) out.cameras.push_back(camera->description());
  return out;
}

}  // namespace booth::daemon

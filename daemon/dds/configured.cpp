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

}  // namespace booth::daemon

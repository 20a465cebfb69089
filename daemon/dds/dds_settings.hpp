// Where in the network a booth, or somebody who listens to booths, is; as plain values and as the DDS library wants them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace booth::daemon {

struct DdsSettings {
  std::string booth = "booth";  ///< partition; of a listener "*" or one booth's
  std::uint32_t domain = 0;
  std::string interface {};  ///< name or address; empty: the library chooses
  bool multicast = true;
  std::vector<std::string> peers{};
};

/// Cyclone DDS's own configuration for these settings, as XML (what CYCLONEDDS_URI would hold).
std::string dds_configuration(const DdsSettings& settings);

}  // namespace booth::daemon

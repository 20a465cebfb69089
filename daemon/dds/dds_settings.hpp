// Where in the network a booth, or somebody who listens to booths, is; as plain values and as the DDS library wants them.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/depth_frame.hpp"

namespace booth::daemon {

/// The mirror of a booth's skeleton as ROS 2 topics (docs/reference/ros2.md).
struct Ros2Settings {
  std::string name_space{};                       ///< before /humans; empty: none
  std::vector<hal::CameraDescription> cameras{};  ///< whose places are told
};

/// What a participant proves itself with under DDS Security: contents of files, PEM and S/MIME.
struct DdsIdentity {
  std::string identity_ca, certificate, private_key, permissions_ca, governance, permissions;
  std::string revocations{};  ///< path of a list of revoked certificates (the library reads it itself); empty: none
};

struct DdsSettings {
  std::string booth = "booth";  ///< partition; of a listener "*" or one booth's
  std::uint32_t domain = 0;
  std::string interface {};  ///< name or address; empty: the library chooses
  bool multicast = true;
  std::vector<std::string> peers{};
  std::vector<std::string> partitions{};                  ///< of a listener that may hear some booths and not all: these instead of `booth`
  bool secured = false;                                   ///< with it nobody joins in the plain, also not by mistake
  std::shared_ptr<const DdsIdentity> identity = nullptr;  ///< needed where `secured`
  std::optional<Ros2Settings> ros2{};                     ///< of a booth alone; nothing: no mirror
};

/// Cyclone DDS's own configuration for these settings, as XML (what CYCLONEDDS_URI would hold).
std::string dds_configuration(const DdsSettings& settings);

}  // namespace booth::daemon

// The network as the configuration says it.
#pragma once

#include <optional>

#include "daemon/config/config.hpp"
#include "daemon/dds/dds_settings.hpp"
#include "daemon/security/provision.hpp"
#include "hal/depth_camera.hpp"

namespace booth::daemon {

/// Of this booth; a listener changes `booth` to whom it wants to hear. With dds.security = "on" an identity is still to be added: without one nobody joins.
DdsSettings dds_settings(const Config& config);
/// Of a booth with these cameras; nothing where the configuration switches the mirror off.
std::optional<Ros2Settings> ros2_settings(const Config& config, const hal::DepthCameras& cameras);

/// Credentials for that role by the keys dds.security, dds.credentials and dds.self_issued and systemd's $CREDENTIALS_DIRECTORY (a booth's only); nothing
/// where security is off. `may_issue`: as in CredentialQuery. Throws as obtain_credentials().
std::optional<Credentials> dds_credentials(const Config& config, Role role, bool may_issue);

}  // namespace booth::daemon

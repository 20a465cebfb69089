// The network as the configuration says it.
#pragma once

#include "daemon/config/config.hpp"
#include "daemon/dds/dds_settings.hpp"
#include "hal/depth_camera.hpp"

namespace booth::daemon {

/// Of this booth; a listener changes `booth` to whom it wants to hear.
DdsSettings dds_settings(const Config& config);
/// Of a booth with these cameras; nothing where the configuration switches the mirror off.
std::optional<Ros2Settings> ros2_settings(const Config& config, const hal::DepthCameras& cameras);

}  // namespace booth::daemon

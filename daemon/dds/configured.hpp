// The network as the configuration says it.
#pragma once

#include "daemon/config/config.hpp"
#include "daemon/dds/dds_settings.hpp"

namespace booth::daemon {

/// Of this booth; a listener changes `booth` to whom it wants to hear.
DdsSettings dds_settings(const Config& config);

}  // namespace booth::daemon

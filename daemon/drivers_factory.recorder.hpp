// The flight recorder of the configuration, without naming a driver.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/config/config.hpp"
#include "daemon/drivers_factory.hpp"
#include "hal/flight_recorder.hpp"

namespace booth::daemon {

/// Its memory is taken when this returns. The source's clock outlives it. Throws std::bad_alloc.
std::unique_ptr<hal::FlightRecorder> open_recorder(const Config& config, const DepthSource& source);
/// What that takes.
std::size_t recorder_memory(const Config& config, const DepthSource& source);
/// Finishes recordings that a dead boothd left behind; one sentence each.
std::vector<std::string> recover_recordings(const Config& config);

}  // namespace booth::daemon

// The light of a booth whose daemon has failed for good: another process holds it, so that nobody waits before a dark box.
#pragma once

#include <signal.h>

#include <chrono>

#include "daemon/config/load.hpp"

namespace booth::daemon {

/// Blinks FaultCode::failed on gpio.light, takes no other line, and returns at SIGTERM or SIGINT, which must be blocked; at once, saying so, where no light is
/// configured. Of a configuration with mistakes it uses what is right. Throws std::invalid_argument when the keys gpio.* contradict each other.
void show_failed_light(const ConfigSources& sources, const sigset_t& signals);

/// The same for this time at most, saying nothing; waits without a light where there is none or it cannot be had. True when a signal ended it.
bool show_failed_light_for(const ConfigSources& sources, const sigset_t& signals, std::chrono::seconds time);

}  // namespace booth::daemon

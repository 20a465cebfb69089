// What boothd tells systemd: that it is ready, alive, ending.
#pragma once

#include <chrono>
#include <string>

namespace booth::daemon {

/// All do nothing when systemd did not start us.
void notify_ready(const std::string& status);
void notify_status(const std::string& status);
void notify_watchdog();
void notify_stopping();

/// How often the watchdog wants to hear from us (half its limit); zero when it does not.
std::chrono::microseconds watchdog_interval();

}  // namespace booth::daemon

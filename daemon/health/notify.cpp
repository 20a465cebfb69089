// The notify protocol through libsystemd.
#include "daemon/health/notify.hpp"

#include <systemd/sd-daemon.h>

namespace booth::daemon {

void notify_ready(const std::string& status) { sd_notify(0, ("READY=1\nSTATUS=" + status).c_str()); }
void notify_status(const std::string& status) { sd_notify(0, ("STATUS=" + status).c_str()); }
void notify_watchdog() { sd_notify(0, "WATCHDOG=1"); }
void notify_stopping() { sd_notify(0, "STOPPING=1"); }

std::chrono::microseconds watchdog_interval() {
  std::uint64_t limit = 0;
  return sd_watchdog_enabled(0, &limit) > 0 ? std::chrono::microseconds(limit / 2) : std::chrono::microseconds(0);
}

}  // namespace booth::daemon

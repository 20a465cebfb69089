// A pause that doubles with each try, because the machine's uptime does.
#include "daemon/health/another_try.hpp"

#include <time.h>

#include <algorithm>
#include <chrono>

#include "daemon/health/failed_light.hpp"
#include "daemon/health/log.hpp"
#include "daemon/health/notify.hpp"

namespace booth::daemon {

bool pause_before_another_try(const ConfigSources& sources, const sigset_t& signals) {
  timespec up{};
  ::clock_gettime(CLOCK_BOOTTIME, &up);
  const std::chrono::seconds pause(std::clamp<std::int64_t>(up.tv_sec, 1, 20));
  log_line(LogLevel::info, "boothd tries again in " + std::to_string(pause.count()) + " s");
  notify_status("something is missing; boothd tries again in " + std::to_string(pause.count()) + " s");
  return !show_failed_light_for(sources, signals, pause);
}

}  // namespace booth::daemon

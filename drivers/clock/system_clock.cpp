// CLOCK_MONOTONIC, CLOCK_REALTIME and an absolute sleep, which a signal may interrupt but not shorten.
#include "drivers/clock/system_clock.hpp"

#include <time.h>

#include <cerrno>

namespace booth::drivers {
namespace {

hal::Nanoseconds read(clockid_t id) {
  timespec ts{};
  clock_gettime(id, &ts);
  return std::chrono::seconds(ts.tv_sec) + hal::Nanoseconds(ts.tv_nsec);
}

}  // namespace

hal::MonotonicTime SystemClock::now() const { return hal::MonotonicTime(read(CLOCK_MONOTONIC)); }

hal::UtcTime SystemClock::utc_now() const { return hal::UtcTime(read(CLOCK_REALTIME)); }

void SystemClock::sleep_until(hal::MonotonicTime deadline) {
  const auto ns = deadline.time_since_epoch().count();
  const timespec ts{static_cast<time_t>(ns / 1'000'000'000), static_cast<long>(ns % 1'000'000'000)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &ts, nullptr) == EINTR) {
  }
}

}  // namespace booth::drivers

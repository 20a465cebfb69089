// Time as a variable under a mutex.
#include "drivers/clock/manual_clock.hpp"

#include <algorithm>

namespace booth::drivers {

hal::MonotonicTime ManualClock::now() const {
  const std::lock_guard lock(mutex_);
  return now_;
}

hal::UtcTime ManualClock::utc_now() const {
  const std::lock_guard lock(mutex_);
  return hal::UtcTime(now_.time_since_epoch() + utc_offset_);
}

void ManualClock::sleep_until(hal::MonotonicTime deadline) {
  std::unique_lock lock(mutex_);
  if (sleep_ == Sleep::waits) {
    moved_.wait(lock, [&] { return now_ >= deadline; });
  } else {
    now_ = std::max(now_, deadline);
    moved_.notify_all();
  }
}

void ManualClock::advance(hal::Nanoseconds by) {
  const std::lock_guard lock(mutex_);
  now_ += by;
  moved_.notify_all();
}

void ManualClock::step_utc(hal::Nanoseconds by) {
  const std::lock_guard lock(mutex_);
  utc_offset_ += by;
}

}  // namespace booth::drivers

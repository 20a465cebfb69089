// A clock that runs like the wall's and leaps ahead whenever the work of a period is done: replays are as fast as the fit, and nothing is ever too late.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <mutex>

#include "drivers/clock/system_clock.hpp"

namespace booth::tests {

/// Thread-safe.
class EagerClock final : public hal::Clock {
 public:
  hal::MonotonicTime now() const override {
    const std::lock_guard lock(mutex_);
    return system_.now() + ahead_;
  }
  hal::UtcTime utc_now() const override {
    const std::lock_guard lock(mutex_);
    return system_.utc_now() + ahead_;
  }
  void sleep_until(hal::MonotonicTime deadline) override {
    std::unique_lock lock(mutex_);
    while (true) {
      const auto left = deadline - (system_.now() + ahead_);
      if (left <= hal::Nanoseconds::zero()) return;
      leapt_.wait_for(lock, left);
    }
  }
  /// The work of `period` is done: the clock goes on as if the whole of it had passed since the last call.
  void period_done(hal::Nanoseconds period) {
    {
      const std::lock_guard lock(mutex_);
      const hal::MonotonicTime here = system_.now() + ahead_;
      if (last_ != hal::MonotonicTime{} && here < last_ + period) ahead_ += last_ + period - here;
      last_ = system_.now() + ahead_;
    }
    leapt_.notify_all();
  }

 private:
  drivers::SystemClock system_;
  mutable std::mutex mutex_;
  std::condition_variable leapt_;
  hal::Nanoseconds ahead_{};
  hal::MonotonicTime last_{};
};

}  // namespace booth::tests

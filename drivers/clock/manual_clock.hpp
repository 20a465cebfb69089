// A clock that a test moves, so that hours pass in microseconds and the same way each time.
#pragma once

#include <condition_variable>
#include <mutex>

#include "hal/clock.hpp"

namespace booth::drivers {

/// Starts at 1 s monotonic and at 2026-01-01T00:00:00 UTC. Thread-safe.
class ManualClock final : public hal::Clock {
 public:
  enum class Sleep : std::uint8_t {
    advances,  ///< sleeping moves the time to the deadline: one thread never waits
    waits,     ///< sleeping blocks until advance() reaches the deadline
  };
  explicit ManualClock(Sleep sleep = Sleep::advances) : sleep_(sleep) {}

  hal::MonotonicTime now() const override;
  hal::UtcTime utc_now() const override;
  void sleep_until(hal::MonotonicTime deadline) override;

  /// Lets time pass and wakes whoever slept until then.
  void advance(hal::Nanoseconds by);
  /// Moves wall time alone, as a clock step does.
  void step_utc(hal::Nanoseconds by);

 private:
  const Sleep sleep_;
  mutable std::mutex mutex_;
  std::condition_variable moved_;
  hal::MonotonicTime now_{std::chrono::seconds(1)};
  hal::Nanoseconds utc_offset_{std::chrono::seconds(1767225600 - 1)};  // UTC minus monotonic
};

}  // namespace booth::drivers

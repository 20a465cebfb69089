// Where time comes from: the system, or a test that moves it by hand.
#pragma once

#include "hal/time.hpp"

namespace booth::hal {

/// Thread-safe. One instance is shared by the whole process.
class Clock {
 public:
  virtual ~Clock() = default;
  virtual MonotonicTime now() const = 0;
  virtual UtcTime utc_now() const = 0;
  /// Returns at `deadline` or later; at once when it has passed.
  virtual void sleep_until(MonotonicTime deadline) = 0;
};

}  // namespace booth::hal

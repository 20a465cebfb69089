// The operating system's clocks behind hal::Clock.
#pragma once

#include "hal/clock.hpp"

namespace booth::drivers {

class SystemClock final : public hal::Clock {
 public:
  hal::MonotonicTime now() const override;
  hal::UtcTime utc_now() const override;
  void sleep_until(hal::MonotonicTime deadline) override;
};

}  // namespace booth::drivers

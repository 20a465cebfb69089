// The one thing a visitor sees besides the button.
#pragma once

#include <cstdint>

namespace booth::hal {

enum class LightPattern : std::uint8_t { off, idle_steady, estimating_fast_blink, tracking_on, searching_slow_blink, fault_code };

/// Thread-safe; returns at once.
class StatusLight {
 public:
  virtual ~StatusLight() = default;
  /// `code` is the number of blinks of fault_code, ignored otherwise.
  virtual void show(LightPattern pattern, int code = 0) = 0;
};

}  // namespace booth::hal

// The one thing a visitor sees besides the button.
#pragma once

#include <cstdint>

namespace booth::hal {

/// What each looks like on a lamp of one colour: docs/guide/buttons-and-light.md.
enum class LightPattern : std::uint8_t {
  off,
  idle_steady,
  countdown_double_blink,
  estimating_fast_blink,
  tracking_on,
  searching_slow_blink,
  saving_flash,
  fault_code,
};

struct LightShow {
  LightPattern pattern = LightPattern::off;
  int code = 0;           ///< number of blinks of fault_code, 1 to 9; ignored otherwise
  bool degraded = false;  ///< a flicker every few seconds on top of the pattern: works, but something is missing
  bool operator==(const LightShow&) const = default;
};

/// Thread-safe; returns at once and never throws.
class StatusLight {
 public:
  virtual ~StatusLight() = default;
  /// Shown until something else is. Showing the same again changes nothing: a pattern is not begun anew.
  virtual void show(const LightShow& show) = 0;
};

}  // namespace booth::hal

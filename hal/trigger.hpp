// Buttons: start, stop, toggle, the long press that asks for a calibration, and emergency stop, as events with the kernel's own time stamps.
#pragma once

#include <cstdint>
#include <optional>

#include "hal/time.hpp"

namespace booth::hal {

enum class TriggerKind : std::uint8_t { start, stop, toggle, calibrate, emergency_pressed, emergency_released };

struct TriggerEvent {
  TriggerKind kind{};
  MonotonicTime at{};  ///< of the first edge of the press, before any bouncing
};

/// wait() is called by one thread; a press is reported once, after debouncing. A button that is pressed already when it is first seen is no press.
/// An emergency stop that cannot be read counts as pressed.
class Trigger {
 public:
  virtual ~Trigger() = default;
  /// Nothing when nothing happened within `timeout`. Never throws: what is wrong with a device is said by Panel::problems().
  virtual std::optional<TriggerEvent> wait(Nanoseconds timeout) = 0;
};

}  // namespace booth::hal

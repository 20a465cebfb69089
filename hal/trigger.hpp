// Buttons: start, stop, toggle and emergency stop, as events with the kernel's own time stamps.
#pragma once

#include <cstdint>
#include <optional>

#include "hal/time.hpp"

namespace booth::hal {

enum class TriggerKind : std::uint8_t { start, stop, toggle, emergency_pressed, emergency_released };

struct TriggerEvent {
  TriggerKind kind{};
  MonotonicTime at{};
};

/// wait() is called by one thread; a press is reported once, after debouncing.
class Trigger {
 public:
  virtual ~Trigger() = default;
  virtual std::optional<TriggerEvent> wait(Nanoseconds timeout) = 0;
};

}  // namespace booth::hal

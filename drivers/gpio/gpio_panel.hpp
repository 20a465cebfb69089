// Buttons, light and buzzer on the lines of one GPIO chip: whatever happens to chip and lines, a panel that goes on and says what is wrong.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "drivers/gpio/button.hpp"
#include "drivers/gpio/chip.hpp"
#include "hal/clock.hpp"
#include "hal/panel.hpp"

namespace booth::drivers::gpio {

enum class Role : std::uint8_t { start, stop, toggle, emergency_stop, light, buzzer };

struct PanelSettings {
  struct Line {
    Role role{};
    LineRequest request;
  };
  std::string chip;         ///< label, name or path
  std::vector<Line> lines;  ///< at most kSlots; each role once
  hal::Nanoseconds debounce = std::chrono::milliseconds(20);
  hal::Nanoseconds stuck = std::chrono::seconds(30);  ///< of start, stop and toggle
  /// A start or toggle button that is pressed for so long asks for a calibration instead, and a shorter press counts when it is let go. 0: presses of any
  /// length are the same, and count as soon as they have settled.
  hal::Nanoseconds long_press{0};
  int edges_per_second = 200;
  hal::Nanoseconds first_retry = std::chrono::milliseconds(500), last_retry = std::chrono::seconds(10);  ///< doubling from one to the other
};

/// A thread of its own does all that is done with the chip. A chip or line that cannot be had, or is lost, is tried again; until then an emergency stop
/// that should be on it counts as pressed. `clock` must outlive the panel. Throws std::invalid_argument when there are too many lines.
std::unique_ptr<hal::Panel> make_gpio_panel(std::unique_ptr<ChipSource> chips, PanelSettings settings, const hal::Clock& clock);

}  // namespace booth::drivers::gpio

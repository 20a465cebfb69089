// Buttons and light of the configuration, real or simulated, without naming a driver.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/config/config.hpp"
#include "daemon/config/key_problem.hpp"
#include "hal/clock.hpp"
#include "hal/gpio_chips.hpp"
#include "hal/panel.hpp"

namespace booth::daemon {

/// The hands and eyes of whoever stands before a simulated panel. Thread-safe.
class SimulatedVisitor {
 public:
  struct LampChange {
    hal::MonotonicTime at{};
    bool on = false;
  };
  virtual ~SimulatedVisitor() = default;
  /// False when the panel has no such button: "start", "stop", "emergency_stop".
  virtual bool press(const std::string& button, bool down) = 0;
  /// What "light" or "buzzer" did, oldest first, as far as it is remembered; empty for anything else.
  virtual std::vector<LampChange> history(const std::string& lamp) const = 0;
  virtual bool lit(const std::string& lamp) const = 0;
};

struct PanelDevice {
  std::shared_ptr<SimulatedVisitor> visitor;  ///< null unless gpio.chip is "simulated"
  std::unique_ptr<hal::Panel> panel;          ///< null where gpio.chip is empty
};

/// Where keys of gpio.* contradict each other; touches nothing.
std::vector<KeyProblem> panel_problems(const Config& config);

/// Chips and lines that are not there are no errors: they are the panel's problems. `clock` must outlive the panel. Throws
/// std::invalid_argument with the first of panel_problems().
PanelDevice open_panel(const Config& config, const hal::Clock& clock);

/// What there is on this machine, without touching a line.
hal::GpioChips list_gpio_chips();

}  // namespace booth::daemon

// From the keys gpio.* to a panel.
#include "daemon/drivers_factory.gpio.hpp"

#include <fmt/format.h>

#include <map>
#include <stdexcept>

#include "drivers/gpio/gpio_panel.hpp"
#include "drivers/gpio/gpiod_chips.hpp"
#include "drivers/gpio/simulated_board.hpp"

namespace booth::daemon {
namespace {

namespace gpio = drivers::gpio;
using Gpio = decltype(Config::gpio);

const char* const kSimulated = "simulated";

gpio::Bias bias_of(const std::string& name) {
  if (name == "disabled") return gpio::Bias::disabled;
  if (name == "pull-up") return gpio::Bias::pull_up;
  if (name == "pull-down") return gpio::Bias::pull_down;
  return gpio::Bias::as_is;
}

struct NamedLine {
  const char *name, *key;
  const std::string& line;
};
std::vector<NamedLine> lines_of(const Gpio& keys) {
  return {{"start", "gpio.start", keys.start},
          {"stop", "gpio.stop", keys.stop},
          {"emergency_stop", "gpio.emergency_stop", keys.emergency_stop},
          {"light", "gpio.light", keys.light},
          {"buzzer", "gpio.buzzer", keys.buzzer}};
}

std::vector<KeyProblem> problems_of(const Gpio& keys) {
  std::vector<KeyProblem> out;
  std::map<std::string, NamedLine> taken;
  for (const NamedLine& one : lines_of(keys)) {
    const auto& [name, key, line] = one;
    if (line.empty()) continue;
    if (keys.chip.empty()) out.push_back({{key, "gpio.chip"}, fmt::format("{} is set and gpio.chip is not: say on which chip the line is", key)});
    const auto [other, fresh] = taken.emplace(line, one);
    if (!fresh) out.push_back({{other->second.key, key}, fmt::format("{} and {} are the same line \"{}\": give each its own", other->second.key, key, line)});
  }
  if (!keys.chip.empty() && taken.empty()) out.push_back({{"gpio.chip"}, "gpio.chip is set and no line is: set gpio.start, gpio.light ..."});
  if (keys.long_press_seconds >= keys.stuck_seconds)
    out.push_back({{"gpio.long_press_seconds", "gpio.stuck_seconds"},
                   fmt::format("gpio.long_press_seconds = {} is no shorter than gpio.stuck_seconds = {}: a long press would be a stuck button",
                               keys.long_press_seconds, keys.stuck_seconds)});
  if (!keys.stop.empty() && keys.start.empty())
    out.push_back({{"gpio.stop", "gpio.start"}, "gpio.stop is set and gpio.start is not: one button alone is gpio.start, it stops, too"});
  return out;
}

gpio::PanelSettings panel_settings(const Gpio& keys) {
  gpio::PanelSettings out;
  out.chip = keys.chip;
  out.debounce = hal::from_seconds(keys.debounce_ms / 1000);
  out.long_press = hal::from_seconds(keys.long_press_seconds);
  out.stuck = hal::from_seconds(keys.stuck_seconds);
  const auto input = [&](gpio::Role role, const std::string& line, bool active_low) {
    if (!line.empty()) out.lines.push_back({role, {.line = line, .output = false, .active_low = active_low, .bias = bias_of(keys.bias)}});
  };
  const auto output = [&](gpio::Role role, const std::string& line) {
    if (!line.empty()) out.lines.push_back({role, {.line = line, .output = true, .active_low = keys.light_active_low}});
  };
  input(keys.stop.empty() ? gpio::Role::toggle : gpio::Role::start, keys.start, keys.active_low);
  input(gpio::Role::stop, keys.stop, keys.active_low);
  input(gpio::Role::emergency_stop, keys.emergency_stop, keys.emergency_stop_active_low);
  output(gpio::Role::light, keys.light);
  output(gpio::Role::buzzer, keys.buzzer);
  return out;
}

class Visitor final : public SimulatedVisitor {
 public:
  Visitor(const hal::Clock& clock, const Gpio& keys) : keys_(keys), board_(clock, kSimulated, names(keys)) {
    // The contact of an emergency stop drives its line when at rest, so that a cut wire is a stop.
    if (!keys.emergency_stop.empty()) board_.drive(keys.emergency_stop, keys.emergency_stop_active_low);
  }

  bool press(const std::string& button, bool down) override {
    const std::string line = button == "light" || button == "buzzer" ? "" : line_of(button);
    if (!line.empty()) board_.press(line, down);
    return !line.empty();
  }
  std::vector<LampChange> history(const std::string& lamp) const override {
    std::vector<LampChange> out;
    if (const std::string line = line_of(lamp); !line.empty())
      for (const auto& change : board_.history(line)) out.push_back({change.at, change.active});
    return out;
  }
  bool lit(const std::string& lamp) const override {
    const std::string line = line_of(lamp);
    return !line.empty() && board_.lit(line);
  }
  gpio::SimulatedBoard& board() { return board_; }

 private:
  static std::vector<std::string> names(const Gpio& keys) {
    std::vector<std::string> out;
    for (const auto& one : lines_of(keys))
      if (!one.line.empty()) out.push_back(one.line);
    return out;
  }
  std::string line_of(const std::string& key) const {
    for (const auto& one : lines_of(keys_))
      if (one.name == key) return one.line;
    return "";
  }

  const Gpio keys_;
  gpio::SimulatedBoard board_;
};

/// The configuration's, and for a simulated chip without lines one of each.
Gpio resolved(const Config& config) {
  Gpio keys = config.gpio;
  if (keys.chip == kSimulated && keys.start.empty() && keys.stop.empty() && keys.emergency_stop.empty() && keys.light.empty() && keys.buzzer.empty()) {
    keys.start = "start";
    keys.emergency_stop = "emergency_stop";
    keys.light = "light";
    keys.buzzer = "buzzer";
  }
  return keys;
}

}  // namespace

std::vector<KeyProblem> panel_problems(const Config& config) { return problems_of(resolved(config)); }

PanelDevice open_panel(const Config& config, const hal::Clock& clock) {
  const Gpio keys = resolved(config);
  if (const auto problems = problems_of(keys); !problems.empty()) throw std::invalid_argument(problems.front().sentence);
  PanelDevice out;
  if (keys.chip.empty()) return out;
  if (keys.chip == kSimulated) {
    auto visitor = std::make_shared<Visitor>(clock, keys);
    out.panel = gpio::make_gpio_panel(gpio::make_simulated_chips(visitor->board()), panel_settings(keys), clock);
    out.visitor = std::move(visitor);
    return out;
  }
  out.panel = gpio::make_gpio_panel(gpio::make_gpiod_chips(), panel_settings(keys), clock);
  return out;
}

hal::GpioChips list_gpio_chips() { return drivers::gpio::list_gpiod_chips(); }

}  // namespace booth::daemon

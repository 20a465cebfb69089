// One line of one chip, until somebody starts boothd again.
#include "daemon/health/failed_light.hpp"

#include <time.h>

#include <exception>

#include "daemon/drivers_factory.gpio.hpp"
#include "daemon/drivers_factory.hpp"
#include "daemon/health/messages.hpp"
#include "daemon/session/light_rule.hpp"

namespace booth::daemon {

namespace {

/// The configuration without the lines that are not this light's.
Config light_alone(const ConfigSources& sources) {
  Config config = load_what_is_right(sources);
  auto& gpio = config.gpio;
  gpio.start.clear();
  gpio.stop.clear();
  gpio.emergency_stop.clear();
  gpio.buzzer.clear();
  return config;
}

bool has_light(const Config& config) { return !config.gpio.chip.empty() && !config.gpio.light.empty(); }
constexpr hal::LightShow kFailed{.pattern = hal::LightPattern::fault_code, .code = static_cast<int>(FaultCode::failed), .degraded = false};

}  // namespace

void show_failed_light(const ConfigSources& sources, const sigset_t& signals) {
  const Config config = light_alone(sources);
  const std::string remedy = "see journalctl -u boothd, then: systemctl reset-failed boothd; systemctl restart boothd";
  if (!has_light(config)) {
    log_message(LogLevel::error, Message::given_up, "boothd has failed and is not tried again, and there is no light to say so (gpio.light); " + remedy);
    return;
  }
  const auto clock = open_system_clock();
  const PanelDevice device = open_panel(config, *clock);
  device.panel->show(kFailed);
  log_message(LogLevel::error, Message::given_up, "boothd has failed and is not tried again: the light says so; " + remedy);
  int signal = 0;
  while (::sigwait(&signals, &signal) == 0 && signal != SIGTERM && signal != SIGINT) continue;
  device.panel->show({});
}

bool show_failed_light_for(const ConfigSources& sources, const sigset_t& signals, std::chrono::seconds time) {
  const auto clock = open_system_clock();
  PanelDevice device;
  try {
    if (const Config config = light_alone(sources); has_light(config)) device = open_panel(config, *clock);
  } catch (const std::exception&) {
    // Then without a light; what is wrong has been said.
  }
  if (device.panel) device.panel->show(kFailed);
  bool told = false;
  for (const auto end = clock->now() + time; !told && clock->now() < end;) {
    const timespec look{0, 250'000'000};
    const int signal = ::sigtimedwait(&signals, nullptr, &look);
    told = signal == SIGTERM || signal == SIGINT;
  }
  return told;
}

}  // namespace booth::daemon

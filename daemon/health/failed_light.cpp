// One line of one chip, until somebody starts boothd again.
#include "daemon/health/failed_light.hpp"

#include "daemon/drivers_factory.gpio.hpp"
#include "daemon/drivers_factory.hpp"
#include "daemon/health/messages.hpp"
#include "daemon/session/light_rule.hpp"

namespace booth::daemon {

void show_failed_light(const ConfigSources& sources, const sigset_t& signals) {
  Config config = load_what_is_right(sources);
  auto& gpio = config.gpio;
  gpio.start.clear();
  gpio.stop.clear();
  gpio.emergency_stop.clear();
  gpio.buzzer.clear();
  const std::string remedy = "see journalctl -u boothd, then: systemctl restart boothd";
  if (gpio.chip.empty() || gpio.light.empty()) {
    log_message(LogLevel::error, Message::given_up, "boothd has failed and is not tried again, and there is no light to say so (gpio.light); " + remedy);
    return;
  }
  const auto clock = open_system_clock();
  const PanelDevice device = open_panel(config, *clock);
  device.panel->show({.pattern = hal::LightPattern::fault_code, .code = static_cast<int>(FaultCode::failed), .degraded = false});
  log_message(LogLevel::error, Message::given_up, "boothd has failed and is not tried again: the light says so; " + remedy);
  int signal = 0;
  while (::sigwait(&signals, &signal) == 0 && signal != SIGTERM && signal != SIGINT) continue;
  device.panel->show({});
}

}  // namespace booth::daemon

// Wait for a press, pass it on, look what came of it, light the light.
#include "daemon/session/panel_link.hpp"

#include "daemon/session/light_rule.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;

SessionEvent event_of(hal::TriggerKind kind) {
  switch (kind) {
    case hal::TriggerKind::start:
      return SessionEvent::start;
    case hal::TriggerKind::stop:
      return SessionEvent::stop;
    case hal::TriggerKind::toggle:
      return SessionEvent::toggle;
    case hal::TriggerKind::calibrate:
      return SessionEvent::calibrate;
    case hal::TriggerKind::emergency_pressed:
      return SessionEvent::emergency_pressed;
    case hal::TriggerKind::emergency_released:
      return SessionEvent::emergency_released;
  }
  return SessionEvent::emergency_pressed;
}

}  // namespace

PanelLink::PanelLink(hal::Panel& panel, Controller& controller) : panel_(panel), controller_(controller), thread_([this] { loop(); }) {}

PanelLink::~PanelLink() {
  stop_ = true;
  thread_.join();
  panel_.show({});
}

void PanelLink::loop() {
  while (!stop_) {
    progress_.fetch_add(1, std::memory_order_relaxed);
    if (const auto event = panel_.wait(50ms)) request(*event);
    show();
  }
}

void PanelLink::request(const hal::TriggerEvent& event) {
  const ControlAnswer answer = controller_.request(event_of(event.kind), "gpio");
  if (event.kind != hal::TriggerKind::emergency_released) panel_.play(answer.accepted ? hal::Sound::accepted : hal::Sound::refused);
}

void PanelLink::show() {
  const std::vector<std::string> problems = panel_.problems();
  const DaemonStatus status = controller_.status();
  const LightFacts facts{.state = status.state,
                         .latched = status.latched,
                         .paused = status.paused,
                         .degraded = status.degraded || !status.backend.problem.empty() || !status.drift_problem.empty(),
                         .alarm = !status.session_alarm.empty(),
                         .panel = !problems.empty()};
  const hal::LightShow light = light_of(facts);
  panel_.show(light);
  controller_.set_panel({.present = true, .light = light, .problems = problems});
  if (status.state == SessionState::tracking && state_ == SessionState::estimating) panel_.play(hal::Sound::found);
  if (status.state == SessionState::finishing && state_ != SessionState::finishing) panel_.play(hal::Sound::ended);
  if (status.countdown_seconds != counted_ && status.countdown_seconds > 0) panel_.play(hal::Sound::countdown);
  counted_ = status.countdown_seconds;
  state_ = status.state;
}

}  // namespace booth::daemon

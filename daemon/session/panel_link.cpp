// Wait for a press, pass it on, look what came of it, light the light.
#include "daemon/session/panel_link.hpp"

#include <algorithm>

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
  waiting_ = true;
  const ControlAnswer answer = controller_.request(event_of(event.kind), "gpio");
  waiting_ = false;
  if (event.kind != hal::TriggerKind::emergency_released) panel_.play(answer.accepted ? hal::Sound::accepted : hal::Sound::refused);
}

void PanelLink::show() {
  const std::vector<std::string> problems = panel_.problems();
  const DaemonStatus status = controller_.status();
  const bool decoded_elsewhere = std::any_of(status.cameras.begin(), status.cameras.end(), [](const CameraStatus& c) { return !c.decoding.problem.empty(); });
  const LightFacts facts{
      .state = status.state,
      .latched = status.latched,
      .paused = status.paused,
      .degraded = status.degraded || status.dds_absent || !status.backend.problem.empty() || decoded_elsewhere || !status.drift_problem.empty(),
      .alarm = !status.session_alarm.empty(),
      .panel = !problems.empty(),
      .cue = status.calibration.cue};
  const hal::LightShow light = light_of(facts);
  panel_.show(light);
  controller_.set_panel({.present = true, .light = light, .problems = problems});
  if (status.state == SessionState::tracking && state_ == SessionState::estimating) panel_.play(hal::Sound::found);
  if (status.state == SessionState::finishing && state_ != SessionState::finishing) panel_.play(hal::Sound::ended);
  if (status.countdown_seconds != counted_ && status.countdown_seconds > 0) panel_.play(hal::Sound::countdown);
  counted_ = status.countdown_seconds;
  play_calibration(status.calibration);
  state_ = status.state;
}

/// A sound for each view and for the end; three beeps, once, for a board that is not ours.
void PanelLink::play_calibration(const CalibrationStatus& now) {
  using Outcome = CalibrationStatus::Outcome;
  if (now.begun == calibration_.begun && now.running) {
    if (now.views > calibration_.views)
      panel_.play(hal::Sound::accepted);
    else if (now.cue == CaptureCue::wrong_board && calibration_.cue != CaptureCue::wrong_board)
      panel_.play(hal::Sound::refused);
  }
  if (!now.running && calibration_.running)
    panel_.play(now.outcome == Outcome::stored || now.outcome == Outcome::cancelled ? hal::Sound::ended : hal::Sound::refused);
  calibration_ = now;
}

}  // namespace booth::daemon

// What the controller does with a calibration: asks whether there can be one, tells how far it is, notices its end.
#include <fmt/format.h>

#include "daemon/health/log.hpp"
#include "daemon/session/controller.hpp"

namespace booth::daemon {

/// What the table cannot know: whether there is anybody who can calibrate. What the state forbids is the table's to say.
std::string Controller::why_no_calibration() const {
  if (machine_.state() != SessionState::idle || machine_.latched()) return {};
  return settings_.calibrator ? settings_.calibrator->why_not() : "this booth has no cameras that can be calibrated";
}

/// Each view is an event, and how it ended.
void Controller::watch_calibration() {
  if (!settings_.calibrator) return;
  CalibrationStatus now = settings_.calibrator->status();
  if (now.running && now.begun == calibration_said_.begun && now.views > calibration_said_.views)
    say_event("state", "calibration", fmt::format("view {} taken (seen by {}); {}", now.views, now.seen, now.next.empty() ? "views are enough" : now.next));
  const bool ended = !now.running && now.begun > 0 && (calibration_said_.running || now.begun != calibration_said_.begun);
  calibration_said_ = now;
  if (!ended) return;
  const bool bad = now.outcome == CalibrationStatus::Outcome::refused || now.outcome == CalibrationStatus::Outcome::failed;
  log_line(bad ? LogLevel::warning : LogLevel::info, fmt::format("calibration {}: {}", to_string(now.outcome), now.sentence));
  say_event("state", "calibration", fmt::format("{}: {}", to_string(now.outcome), now.sentence));
  if (machine_.state() == SessionState::calibrating) apply(machine_.handle(SessionEvent::calibration_over, clock_.now()), "calibration");
}

}  // namespace booth::daemon

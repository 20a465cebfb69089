// The table itself, and the few things that a table cannot say: the latch, the guard time, the limits.
#include "daemon/session/session_machine.hpp"

#include <algorithm>
#include <array>

namespace booth::daemon {
namespace {

using S = SessionState;
using A = SessionAction;

struct Cell {
  S next;
  A action = A::none;
  std::string_view refusal = {};
};

constexpr std::string_view kRunning = "a session is running already";
constexpr std::string_view kSaving = "the last session is still being saved; try again in a moment";
constexpr std::string_view kNothing = "no session is running";
constexpr std::string_view kInTheWay = "a calibration needs the empty stage; end the session first";
constexpr std::string_view kCalibrating = "a calibration is running; stop it first";
constexpr std::string_view kCalibratingAlready = "a calibration is running already";
constexpr std::string_view kCounting = "a session is about to begin already";

constexpr Cell kEnd{S::finishing, A::end}, kBegin{S::estimating, A::begin}, kCancel{S::idle, A::cancel_calibration}, kStay{S::calibrating};

// Rows: events in the order of SessionEvent. Columns: idle, estimating, tracking, searching, finishing, countdown, calibrating.
constexpr std::array<std::array<Cell, kSessionStates>, kSessionEvents> kTable{{
    /* start */
    {{{S::countdown},
      {S::estimating, A::none, kRunning},
      {S::tracking, A::none, kRunning},
      {S::searching, A::none, kRunning},
      {S::finishing, A::none, kSaving},
      {S::countdown, A::none, kCounting},
      {S::calibrating, A::none, kCalibrating}}},
    /* stop: nothing has been captured in a countdown, so nothing is to be saved */
    {{{S::idle, A::none, kNothing}, kEnd, kEnd, kEnd, {S::finishing}, {S::idle}, kCancel}},
    /* toggle */
    {{{S::countdown}, kEnd, kEnd, kEnd, {S::finishing, A::none, kSaving}, {S::idle}, kCancel}},
    /* emergency_pressed */
    {{{S::idle}, kEnd, kEnd, kEnd, {S::finishing}, {S::idle}, kCancel}},
    /* emergency_released */
    {{{S::idle}, {S::estimating}, {S::tracking}, {S::searching}, {S::finishing}, {S::countdown}, kStay}},
    /* body_accepted */
    {{{S::idle}, {S::tracking}, {S::tracking}, {S::searching}, {S::finishing}, {S::countdown}, kStay}},
    /* person_lost */
    {{{S::idle}, {S::searching}, {S::searching}, {S::searching}, {S::finishing}, {S::countdown}, kStay}},
    /* person_found: to estimating instead where the body is not known yet */
    {{{S::idle}, {S::estimating}, {S::tracking}, {S::tracking}, {S::finishing}, {S::countdown}, kStay}},
    /* search_over */
    {{{S::idle}, {S::estimating}, {S::tracking}, kEnd, {S::finishing}, {S::countdown}, kStay}},
    /* session_over */
    {{{S::idle}, kEnd, kEnd, kEnd, {S::finishing}, {S::countdown}, kStay}},
    /* sources_ended */
    {{{S::idle}, kEnd, kEnd, kEnd, {S::finishing}, {S::idle}, kCancel}},
    /* files_written */
    {{{S::idle}, {S::estimating}, {S::tracking}, {S::searching}, {S::idle}, {S::countdown}, kStay}},
    /* countdown_over */
    {{{S::idle}, {S::estimating}, {S::tracking}, {S::searching}, {S::finishing}, kBegin, kStay}},
    /* estimate_over */
    {{{S::idle}, kEnd, {S::tracking}, {S::searching}, {S::finishing}, {S::countdown}, kStay}},
    /* pause_over */
    {{{S::idle}, kEnd, kEnd, kEnd, {S::finishing}, {S::countdown}, kStay}},
    /* calibrate */
    {{{S::calibrating, A::calibrate},
      {S::estimating, A::none, kInTheWay},
      {S::tracking, A::none, kInTheWay},
      {S::searching, A::none, kInTheWay},
      {S::finishing, A::none, kInTheWay},
      {S::countdown, A::none, kInTheWay},
      {S::calibrating, A::none, kCalibratingAlready}}},
    /* calibration_over */
    {{{S::idle}, {S::estimating}, {S::tracking}, {S::searching}, {S::finishing}, {S::countdown}, {S::idle}}},
}};

constexpr std::array<std::string_view, kSessionStates> kStateNames{"idle", "estimating", "tracking", "searching", "finishing", "countdown", "calibrating"};
constexpr std::array<std::string_view, kSessionEvents> kEventNames{
    "start",          "stop",          "toggle",      "emergency_pressed", "emergency_released", "body_accepted",
    "person_lost",    "person_found",  "search_over", "session_over",      "sources_ended",      "files_written",
    "countdown_over", "estimate_over", "pause_over",  "calibrate",         "calibration_over"};

}  // namespace

std::string_view to_string(SessionState s) { return kStateNames[static_cast<std::size_t>(s)]; }
std::string_view to_string(SessionEvent e) { return kEventNames[static_cast<std::size_t>(e)]; }

SessionOutcome session_transition(SessionState state, SessionEvent event) {
  const Cell& cell = kTable[static_cast<std::size_t>(event)][static_cast<std::size_t>(state)];
  return {.from = state, .to = cell.next, .event = event, .action = cell.action, .refusal = cell.refusal};
}

SessionOutcome SessionMachine::handle(SessionEvent event, hal::MonotonicTime now) {
  const auto refuse = [&](std::string_view why) {
    SessionOutcome out = unchanged();
    out.event = event;
    out.refusal = why;
    return out;
  };
  if (event == SessionEvent::emergency_pressed) latched_ = true;
  if (event == SessionEvent::emergency_released) latched_ = false;
  if (event == SessionEvent::toggle) {
    const bool again = toggled_ && now - last_toggle_ < limits_.toggle_guard;
    toggled_ = true;
    last_toggle_ = now;  // a button that keeps bouncing stays one press
    if (again) return refuse("the button was pressed only just before");
  }
  SessionOutcome out = session_transition(state_, event);
  if (out.to == SessionState::countdown && out.changed()) {
    if (latched_) return refuse("the emergency stop is pressed; release it first");
    counting_since_ = now;
    if (limits_.countdown.count() <= 0) {  // over at once: the cause stays what a person did
      out = session_transition(SessionState::countdown, SessionEvent::countdown_over);
      out.from = state_;
      out.event = event;
    }
  }
  if (out.action == SessionAction::calibrate && latched_) return refuse("the emergency stop is pressed; release it first");
  if (out.action == SessionAction::begin) {
    began_ = last_seen_ = last_tick_ = now;
    estimating_ = hal::Nanoseconds(0);
    body_known_ = paused_ = false;
  }
  if (event == SessionEvent::person_found && state_ == SessionState::searching && !body_known_) out.to = SessionState::estimating;
  state_ = out.to;
  return out;
}

SessionOutcome SessionMachine::frame(bool person_there, bool body_accepted, hal::MonotonicTime now) {
  if (!running()) return unchanged();
  if (person_there) {
    last_seen_ = now;
    body_known_ = body_known_ || body_accepted;
    if (state_ == SessionState::searching) return handle(SessionEvent::person_found, now);
    if (state_ == SessionState::estimating && body_known_) return handle(SessionEvent::body_accepted, now);
  } else if (state_ != SessionState::searching && now - last_seen_ >= limits_.lost) {
    return handle(SessionEvent::person_lost, now);
  }
  return unchanged();
}

SessionOutcome SessionMachine::tick(hal::MonotonicTime now, bool paused) {
  if (state_ == SessionState::countdown) return now - counting_since_ >= limits_.countdown ? handle(SessionEvent::countdown_over, now) : unchanged();
  if (!running()) return unchanged();
  const hal::Nanoseconds passed = now - last_tick_;
  last_tick_ = now;
  if (now - began_ >= limits_.session) return handle(SessionEvent::session_over, now);
  if (paused && !paused_) paused_since_ = now;
  paused_ = paused;
  if (paused) {
    last_seen_ = now;
    return now - paused_since_ >= limits_.pause ? handle(SessionEvent::pause_over, now) : unchanged();
  }
  if (state_ == SessionState::searching) return now - last_seen_ >= limits_.search ? handle(SessionEvent::search_over, now) : unchanged();
  if (state_ == SessionState::estimating) {
    estimating_ += passed;
    return estimating_ >= limits_.estimate ? handle(SessionEvent::estimate_over, now) : unchanged();
  }
  // No frames at all is nobody seen, too; but the first estimate may take its time.
  if (now - last_seen_ >= 4 * limits_.lost) return handle(SessionEvent::person_lost, now);
  return unchanged();
}

int SessionMachine::countdown_left(hal::MonotonicTime now) const {
  if (state_ != SessionState::countdown) return 0;
  const hal::Nanoseconds left = limits_.countdown - (now - counting_since_);
  return static_cast<int>(std::chrono::ceil<std::chrono::seconds>(std::max(left, hal::Nanoseconds(0))).count());
}

}  // namespace booth::daemon

// The table itself, and the few things that a table cannot say: the latch, the guard time, the limits.
#include "daemon/session/session_machine.hpp"

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

// Rows: events in the order of SessionEvent. Columns: idle, estimating, tracking, searching, finishing.
constexpr std::array<std::array<Cell, kSessionStates>, kSessionEvents> kTable{{
    /* start */
    {{{S::estimating, A::begin},
      {S::estimating, A::none, kRunning},
      {S::tracking, A::none, kRunning},
      {S::searching, A::none, kRunning},
      {S::finishing, A::none, kSaving}}},
    /* stop */
    {{{S::idle, A::none, kNothing}, {S::finishing, A::end}, {S::finishing, A::end}, {S::finishing, A::end}, {S::finishing}}},
    /* toggle */
    {{{S::estimating, A::begin}, {S::finishing, A::end}, {S::finishing, A::end}, {S::finishing, A::end}, {S::finishing, A::none, kSaving}}},
    /* emergency_pressed */
    {{{S::idle}, {S::finishing, A::end}, {S::finishing, A::end}, {S::finishing, A::end}, {S::finishing}}},
    /* emergency_released */
    {{{S::idle}, {S::estimating}, {S::tracking}, {S::searching}, {S::finishing}}},
    /* body_accepted */
    {{{S::idle}, {S::tracking}, {S::tracking}, {S::searching}, {S::finishing}}},
    /* person_lost */
    {{{S::idle}, {S::searching}, {S::searching}, {S::searching}, {S::finishing}}},
    /* person_found: to estimating instead where the body is not known yet */
    {{{S::idle}, {S::estimating}, {S::tracking}, {S::tracking}, {S::finishing}}},
    /* search_over */
    {{{S::idle}, {S::estimating}, {S::tracking}, {S::finishing, A::end}, {S::finishing}}},
    /* session_over */
    {{{S::idle}, {S::finishing, A::end}, {S::finishing, A::end}, {S::finishing, A::end}, {S::finishing}}},
    /* sources_ended */
    {{{S::idle}, {S::finishing, A::end}, {S::finishing, A::end}, {S::finishing, A::end}, {S::finishing}}},
    /* files_written */
    {{{S::idle}, {S::estimating}, {S::tracking}, {S::searching}, {S::idle}}},
}};

constexpr std::array<std::string_view, kSessionStates> kStateNames{"idle", "estimating", "tracking", "searching", "finishing"};
constexpr std::array<std::string_view, kSessionEvents> kEventNames{"start",         "stop",         "toggle",       "emergency_pressed", "emergency_released",
                                                                   "body_accepted", "person_lost",  "person_found", "search_over",       "session_over",
                                                                   "sources_ended", "files_written"};

}  // namespace

std::string_view to_string(SessionState s) { return kStateNames[static_cast<std::size_t>(s)]; }
std::string_view to_string(SessionEvent e) { return kEventNames[static_cast<std::size_t>(e)]; }

SessionOutcome session_transition(SessionState state, SessionEvent event) {
  const Cell& cell = kTable[static_cast<std::size_t>(event)][static_cast<std::size_t>(state)];
  return {.from = state, .to = cell.next, .action = cell.action, .refusal = cell.refusal};
}

SessionOutcome SessionMachine::handle(SessionEvent event, hal::MonotonicTime now) {
  const auto refuse = [&](std::string_view why) {
    SessionOutcome out = unchanged();
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
  if (out.action == SessionAction::begin) {
    if (latched_) return refuse("the emergency stop is pressed; release it first");
    began_ = last_seen_ = now;
    body_known_ = false;
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
  if (!running()) return unchanged();
  if (now - began_ >= limits_.session) return handle(SessionEvent::session_over, now);
  if (paused) {
    last_seen_ = now;
    return unchanged();
  }
  if (state_ == SessionState::searching) return now - last_seen_ >= limits_.search ? handle(SessionEvent::search_over, now) : unchanged();
  // No frames at all is nobody seen, too; but the first estimate may take its time.
  if (state_ == SessionState::tracking && now - last_seen_ >= 4 * limits_.lost) return handle(SessionEvent::person_lost, now);
  return unchanged();
}

}  // namespace booth::daemon

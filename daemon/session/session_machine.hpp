// What happens to a session when: one table of states and events, with time as an input.
#pragma once

#include <cstdint>
#include <string_view>

#include "hal/time.hpp"

namespace booth::daemon {

enum class SessionState : std::uint8_t {
  idle,         ///< nobody is captured
  estimating,   ///< a body is being estimated
  tracking,     ///< the body is known and followed
  searching,    ///< the person is not there (any more)
  finishing,    ///< the session's files are being written
  countdown,    ///< a session was asked for and begins in a moment
  calibrating,  ///< a person shows the calibration board to the cameras
};
inline constexpr int kSessionStates = 7;

enum class SessionEvent : std::uint8_t {
  start,               ///< a person asks for a session
  stop,                ///< a person ends it
  toggle,              ///< one button for both
  emergency_pressed,   ///< ends the session and refuses new ones ...
  emergency_released,  ///< ... until released; it does not start one
  body_accepted,       ///< the fit has settled on a body
  person_lost,         ///< nobody seen for lost_seconds
  person_found,        ///< somebody seen again
  search_over,         ///< nobody seen for search_seconds
  session_over,        ///< the session has lasted max_seconds
  sources_ended,       ///< no camera will deliver anything more
  files_written,       ///< the session's files are complete, or it was found that they cannot be written
  countdown_over,      ///< the visitor has had countdown_seconds to step onto the stage
  estimate_over,       ///< no body found within estimate_seconds
  pause_over,          ///< too few cameras for pause_seconds
  calibrate,           ///< a person asks for a calibration (a long press)
  calibration_over,    ///< it has ended, however
};
inline constexpr int kSessionEvents = 17;

/// What the owner of the machine has to do; at most one for each event.
enum class SessionAction : std::uint8_t { none, begin, end, calibrate, cancel_calibration };

/// `refusal` is empty when the event was accepted (also when it changed nothing). `event` is what decided: where time or a frame was handed in, the event
/// that they came to.
struct SessionOutcome {
  SessionState from{}, to{};
  SessionEvent event{};
  SessionAction action = SessionAction::none;
  std::string_view refusal{};
  bool changed() const { return from != to; }
};

std::string_view to_string(SessionState s);
std::string_view to_string(SessionEvent e);

/// The state as DDS knows it: booth.idl has the same names in the same order.
constexpr std::uint8_t wire_state(SessionState s) { return static_cast<std::uint8_t>(s); }

/// One cell of the table, before latch, guard time and knowledge of the body are looked at.
SessionOutcome session_transition(SessionState state, SessionEvent event);

/// Pure: no threads, no clock, no allocation.
class SessionMachine {
 public:
  struct Limits {
    hal::Nanoseconds lost = std::chrono::milliseconds(500);
    hal::Nanoseconds search = std::chrono::seconds(60);
    hal::Nanoseconds session = std::chrono::seconds(1800);
    hal::Nanoseconds estimate = std::chrono::seconds(300);  ///< somebody is there, and no body is found
    hal::Nanoseconds pause = std::chrono::seconds(300);     ///< too few cameras without a break
    hal::Nanoseconds countdown{0};                          ///< from the press to the session; 0: at once
    /// A toggle that follows another within this time is the same press once more.
    hal::Nanoseconds toggle_guard = std::chrono::milliseconds(500);
  };
  explicit SessionMachine(Limits limits) : limits_(limits) {}

  SessionOutcome handle(SessionEvent event, hal::MonotonicTime now);

  /// What a fitted frame says: is a person there, and has the body settled? At most one change of state.
  SessionOutcome frame(bool person_there, bool body_accepted, hal::MonotonicTime now);

  /// What the passing of time alone says. While the fit is paused for want of cameras, `paused` stops the clocks of search and estimate: nobody can be
  /// found.
  SessionOutcome tick(hal::MonotonicTime now, bool paused);

  SessionState state() const { return state_; }
  bool running() const { return state_ == SessionState::estimating || state_ == SessionState::tracking || state_ == SessionState::searching; }
  bool latched() const { return latched_; }
  /// Whole seconds until a countdown is over, rounded up; 0 when none runs.
  int countdown_left(hal::MonotonicTime now) const;
  bool body_known() const { return body_known_; }

 private:
  SessionOutcome unchanged() const { return {.from = state_, .to = state_, .event = {}, .action = SessionAction::none, .refusal = {}}; }

  Limits limits_;
  SessionState state_ = SessionState::idle;
  bool latched_ = false, body_known_ = false, toggled_ = false, paused_ = false;
  hal::MonotonicTime began_{}, last_seen_{}, last_toggle_{}, last_tick_{}, paused_since_{}, counting_since_{};
  hal::Nanoseconds estimating_{0};  ///< time spent looking for a body, without pauses
};

}  // namespace booth::daemon

// What the light says of boothd's state: one function, so that a table can test it.
#pragma once

#include "daemon/calibrate/capture_cue.hpp"
#include "daemon/session/session_machine.hpp"
#include "hal/status_light.hpp"

namespace booth::daemon {

/// Blinks of the fault pattern, in the order in which they are shown when several apply, `failed` by another process when boothd has failed for good;
/// docs/guide/buttons-and-light.md says what to do about each.
enum class FaultCode : int { none = 0, emergency_stop = 1, too_few_cameras = 2, not_saved = 3, panel = 4, failed = 5 };

struct LightFacts {
  SessionState state{};
  bool latched = false;   ///< emergency stop
  bool paused = false;    ///< too few cameras
  bool degraded = false;  ///< a camera is missing, the fit has fallen back to another processor ...
  bool alarm = false;     ///< sessions are not saved
  bool panel = false;     ///< a button or lamp has a problem
  CaptureCue cue{};       ///< in a calibration: what the person should do
};

FaultCode fault_of(const LightFacts& facts);

/// A fault code while nothing runs; of a running session only what stops it: a visitor who is being captured should see that. Other troubles then show as
/// the flicker of `degraded`.
hal::LightShow light_of(const LightFacts& facts);

}  // namespace booth::daemon

// Who calibrates the cameras when the session's controller says so, as the controller and status see it.
#pragma once

#include <cstdint>
#include <string>

#include "daemon/calibrate/capture_cue.hpp"

namespace booth::daemon {

struct CalibrationStatus {
  enum class Outcome : std::uint8_t {
    none,       ///< there has been no calibration yet, or one runs
    stored,     ///< accepted, and written to the file
    refused,    ///< captured, and not good enough or wrong
    cancelled,  ///< by a person or the emergency stop
    failed,     ///< no pictures, no disk, nobody there
  };
  bool running = false;
  std::uint64_t begun = 0;  ///< how many since boothd began
  CaptureCue cue = CaptureCue::search;
  int views = 0;
  std::string seen{};  ///< names of the cameras that see the board now
  std::string next{};  ///< where to hold the board, or what else to do
  Outcome outcome = Outcome::none;
  std::string sentence{};  ///< of the last one that ended: what came of it and why
  bool restart = false;    ///< a new calibration is stored and takes effect when boothd begins anew
};
const char* to_string(CalibrationStatus::Outcome outcome);

/// Thread-safe; none of these waits.
class Calibrator {
 public:
  virtual ~Calibrator() = default;
  /// Why no calibration can begin now, in one sentence; empty: one can.
  virtual std::string why_not() const = 0;
  virtual void begin(const std::string& by) = 0;
  /// Ends it soon; nothing is stored.
  virtual void cancel() = 0;
  virtual CalibrationStatus status() const = 0;
};

}  // namespace booth::daemon

// The requests of the control socket that concern the flight recorder (docs/reference/control-socket.md).
#pragma once

#include <optional>
#include <string>

#include "hal/flight_recorder.hpp"

namespace booth::daemon {

/// A day: longer ones are mistakes.
inline constexpr double kLongestRecording = 86400;

/// Answers `record`, `record_stop`, `record_status` and `snapshot`; nothing for any other line, whatever it holds. Thread-safe.
std::optional<std::string> answer_record_request(const std::string& line, hal::FlightRecorder& recorder);

/// Adds `recorder` to the answer to `status`; any other answer is handed back as it is.
std::string with_recorder(std::string answer, hal::FlightRecorder& recorder);

/// `snapshot` for whoever is not on the control socket (DDS, the watchdog): begins one and says where it will be, or why not.
struct SnapshotAnswer {
  bool accepted = false;
  std::string text;  ///< the path, or why not
};
SnapshotAnswer request_snapshot(hal::FlightRecorder& recorder, const std::string& reason);

}  // namespace booth::daemon

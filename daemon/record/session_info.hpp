// What session.json says besides what is computed from the frames.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "daemon/pipeline/frame_record.hpp"
#include "daemon/pipeline/latency_histogram.hpp"
#include "daemon/record/calibration_used.hpp"

namespace booth::daemon {

/// The `format` of session.json and of the files beside it that this program writes; a session.json without it is of format 1.
inline constexpr std::int64_t kSessionFormat = 1;

/// One thing that happened in a session, or led to it; as on DDS (booth/event).
struct SessionHappening {
  std::int64_t utc_ns = 0;
  std::string kind, source, text;
};

/// Everything that is known when frames have ended. Times in UTC nanoseconds since 1970.
struct SessionInfo {
  std::string id;  ///< the folder's name
  std::string booth, software, source, preset;
  std::vector<std::string> models;   ///< versions
  std::vector<std::string> cameras;  ///< names
  CalibrationUsed calibration;
  std::uint64_t seed = 0;
  int threads = 0;
  std::int64_t began_utc_ns = 0, ended_utc_ns = 0;
  std::string result = "running";  ///< running, complete, interrupted
  std::string reason;              ///< why it ended: stop, emergency_pressed, search_over ...
  std::string state_at_end;
  std::uint64_t groups = 0, groups_dropped = 0, frames_unmatched = 0, frames_not_logged = 0;
  std::vector<SessionHappening> events;  ///< in the order of time
  std::uint64_t events_left_out = 0;     ///< that no room was kept for
  bool live = true;                      ///< false: `track`, which runs in its own time; latencies then mean nothing and are left out
  std::vector<double> detail;            ///< offsets of the detail layer for body.ply, one per vertex of the last body's model; empty: none
  LatencySummary latency;
  std::array<LatencySummary, kStages> stages{};
};

}  // namespace booth::daemon

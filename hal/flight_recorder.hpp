// What keeps the last moments of the booth in memory and writes depth, events and fitted frames to recordings, without ever holding up who hands them in.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "hal/depth_frame.hpp"

namespace booth::hal {

inline constexpr std::size_t kMostRecordedCameras = 8, kRecordedDofs = 36;

/// One fitted frame and the depth frames it was fitted to: what a replay needs to do the same again.
struct FittedGroup {
  std::uint64_t sequence = 0;  ///< since the session began; 0: the person was forgotten before it
  MonotonicTime reference{};
  std::array<MonotonicTime, kMostRecordedCameras> captured{};  ///< of each camera's frame; MonotonicTime{}: not in the group
  std::array<double, kRecordedDofs> q{};                       ///< the pose that was found, CMU frame, metres and radians
  bool person = false;                                         ///< false: nobody was seen, q means nothing
};

/// One recording, in work or the last that was.
struct RecordingStatus {
  std::string path;  ///< the final name; empty: there was none
  bool running = false, depth = false;
  double seconds = 0;        ///< of time recorded so far; of a snapshot: from its first moment to its last
  std::uint64_t frames = 0;  ///< depth frames written
  std::uint64_t missed = 0;  ///< entries that were overwritten in memory before they could be written
  std::uint64_t bytes = 0;   ///< written so far
  std::string problem;       ///< why it ended before its time; empty: as asked
};

struct RecorderStatus {
  bool depth_allowed = false;  ///< depth images are kept in memory and may be written
  double seconds_held = 0;     ///< how far back the memory reaches
  std::size_t bytes_held = 0, bytes_capacity = 0;
  std::uint64_t dropped = 0;  ///< depth frames that found the recorder busy, since the start
  RecordingStatus recording, snapshot;
};

/// frame() by one thread for each camera, fitted() by one thread; both return at once, allocate nothing and throw nothing. All else from any thread.
class FlightRecorder {
 public:
  virtual ~FlightRecorder() = default;

  virtual void frame(const DepthFrame& frame) noexcept = 0;
  virtual void fitted(const FittedGroup& group) noexcept = 0;
  virtual void event(const std::string& kind, const std::string& source, const std::string& text) = 0;

  /// Begins a recording from now on, which ends after `seconds`, or when it was not asked after (status()) for `patience`; zero: nobody needs to ask.
  /// Returns why not, in one sentence; empty when it runs.
  virtual std::string record(bool depth, bool uncompressed, double seconds, Nanoseconds patience) = 0;
  /// Ends the running recording; its files are complete when status() says that it does not run. Harmless when none runs.
  virtual void stop() = 0;
  /// Begins to write what the memory holds. Returns why not; empty when it is being written.
  virtual std::string snapshot(const std::string& reason) = 0;
  /// `asked`: whoever wants the recording to go on, asks.
  virtual RecorderStatus status(bool asked) = 0;
};

}  // namespace booth::hal

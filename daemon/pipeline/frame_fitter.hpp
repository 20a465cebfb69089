// The seam between the pipeline's threads and the mathematics: a group of frames in, a fitted frame out.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "daemon/pipeline/frame_record.hpp"
#include "daemon/pipeline/synchroniser.hpp"
#include "hal/depth_frame.hpp"

namespace booth::daemon {

/// One group's images; valid during the call.
struct FitInput {
  std::uint64_t frame = 0;  ///< since the last reset; keys the random numbers
  hal::MonotonicTime reference{};
  std::array<const hal::DepthFrame*, kMaxCameras> frames{};  ///< nullptr: this camera is not in
};

struct MemoryItem {
  std::string what;
  std::size_t bytes = 0;
};

/// What computes the fit; a copy, taken at one moment.
struct BackendStatus {
  std::string name = "cpu";
  std::string problem;        ///< why a device that was asked for does not compute; empty when it does, or none was asked for
  std::uint64_t losses = 0;   ///< times that the device failed in mid-run
  std::uint64_t changes = 0;  ///< times that the work went from one to the other
};

/// Whether a camera stands where the calibration says, by the people who were followed.
struct CameraDriftStatus {
  enum class Verdict : std::uint8_t { unknown, stands, moved, blind };  ///< too little was seen; it does; it does not; it sees nobody where the others do
  Verdict verdict = Verdict::unknown;
  bool one_of_two = false;                 ///< moved, or the other camera has: only two see the person
  double displacement = 0, deviation = 0;  ///< metres by which its points of a person are off, root mean square, and what chance makes of that
  double turn = 0, shift = 0;              ///< radians and metres (at the middle of a person) that would put them right
  double late = 0, late_deviation = 0;     ///< seconds by which its time stamps lie behind its exposures, against the mean of all
  bool late_known = false;                 ///< the person moved enough to tell
};

/// One thread calls at a time. step() allocates nothing and throws nothing.
class FrameFitter {
 public:
  virtual ~FrameFitter() = default;
  /// Forgets the person.
  virtual void reset() = 0;
  /// Fills what is known of the person, and the durations of the stages `cloud` and `fit`.
  virtual void step(const FitInput& input, FrameRecord& out) = 0;
  /// Why the last step() saw nobody, as a constant sentence; empty when somebody was there.
  virtual const char* remark() const = 0;
  virtual std::vector<MemoryItem> memory_plan() const = 0;
  /// From any thread.
  virtual BackendStatus backend() const { return {}; }
  /// One for each camera, or none where nobody watches. From any thread.
  virtual std::vector<CameraDriftStatus> drift() const { return {}; }
};

}  // namespace booth::daemon

// The one interface behind which every source of depth stands: real, simulated or recorded.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "hal/depth_frame.hpp"

namespace booth::hal {

enum class ReadStatus : std::uint8_t {
  frame,    ///< the slot holds a new frame
  timeout,  ///< nothing yet; try again
  ended,    ///< a finite source has no more frames
  lost,     ///< the device is gone or stalled; start() may bring it back
};

struct CameraCounters {
  std::uint64_t delivered = 0, dropped = 0, corrupt = 0, restarts = 0;
};

/// What makes depth of a camera's signals, where more than one thing can; a copy, taken at one moment.
struct DecodeStatus {
  std::string name;           ///< "cpu avx2", "device cuda ..."; empty: there is nothing to say
  std::string problem;        ///< why what was asked for does not decode; empty when it does, or nothing was asked for
  std::uint64_t losses = 0;   ///< times that it failed in mid-run
  std::uint64_t changes = 0;  ///< times that the work went from one to the other
};

/// Life: start() -> read()* -> stop(), as often as wanted. read() is called by one thread at a time; counters(), decoding() and last_error() by any.
/// Frames come in order of `captured`, each at most once. read() allocates nothing after the first frame.
class DepthCamera {
 public:
  virtual ~DepthCamera() = default;

  /// Valid for the object's whole life.
  virtual const CameraDescription& description() const = 0;

  /// Begins streaming. Throws std::runtime_error naming the device and the remedy.
  virtual void start() = 0;

  /// Ends streaming and wakes a blocked read() (which returns `ended`). Callable from any thread; harmless when stopped.
  virtual void stop() noexcept = 0;

  /// Waits at most `timeout` for the next frame and copies it into `slot`, whose `depth` is resized on first use.
  virtual ReadStatus read(DepthFrame& slot, Nanoseconds timeout) = 0;

  virtual CameraCounters counters() const = 0;
  virtual DecodeStatus decoding() const { return {}; }

  /// One sentence on why the last read() said `lost`; empty otherwise.
  virtual std::string last_error() const = 0;
};

using DepthCameras = std::vector<std::unique_ptr<DepthCamera>>;

}  // namespace booth::hal

// The newest frame of each camera, for somebody who looks slower than cameras deliver.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <vector>

#include "hal/depth_frame.hpp"

namespace booth::daemon {

/// Thread-safe.
class NewestFrames {
 public:
  explicit NewestFrames(std::size_t cameras);

  /// Copies the frame in place of the one before; the camera is the frame's. Allocates for the first one only.
  void put(const hal::DepthFrame& frame);
  /// From now on take() throws this.
  void fail(const std::string& problem);

  /// A frame of each camera that came after the last call. Waits for all of them until `timeout`, though not for one that has been silent for three seconds;
  /// those without are left out. Throws std::runtime_error with what fail() was told.
  std::vector<hal::DepthFrame> take(hal::Nanoseconds timeout);
  /// Positions of cameras that have been silent for three seconds, or never came within three seconds after the beginning.
  std::vector<std::size_t> silent() const;

 private:
  struct Slot {
    hal::DepthFrame frame;
    bool fresh = false;
    std::chrono::steady_clock::time_point when;  ///< wall time: a simulated clock may stand
  };
  bool is_silent(const Slot& slot) const;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Slot> slots_;
  std::string problem_;
};

}  // namespace booth::daemon

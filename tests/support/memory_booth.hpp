// A whole booth on frames from memory: cameras, pipeline, estimator, controller with its session's files, DDS with a reader.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "daemon/dds/ros2/cloud_tap.hpp"
#include "daemon/pipeline/fit_setup.hpp"
#include "daemon/session/controller.hpp"
#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/support/memory_camera.hpp"

namespace booth::tests {

/// What one fitted frame looked like from outside.
struct FrameNote {
  std::int64_t captured_ns = 0, arrived_ns = 0, published_ns = 0;  ///< `arrived`: when the host had the group's last frame
  daemon::PersonState person = daemon::PersonState::lost;
  std::uint8_t cameras = 0;
};

class MemoryBooth {
 public:
  struct Options {
    int threads = 2;
    std::size_t notes = 100000;  ///< how many frames are remembered; further ones are only counted
    std::function<MemoryCamera::Decode(std::size_t camera)> decode;
    bool ros2 = false;  ///< with the ROS 2 mirror, too
  };
  /// Starts a session. `memory` and `clock` outlive the booth.
  MemoryBooth(const FrameMemory& memory, hal::Clock& clock, Options options);
  ~MemoryBooth();

  MemoryCamera& camera(std::size_t i) { return static_cast<MemoryCamera&>(*cameras_[i]); }
  daemon::Pipeline& pipeline() { return *pipeline_; }
  daemon::Controller& controller() { return *controller_; }
  /// Frames that went out.
  std::uint64_t frames() const { return frames_.load(std::memory_order_acquire); }
  /// Samples that the DDS reader has taken.
  std::uint64_t heard() const { return heard_.load(); }
  /// Of the first frames() frames; what is behind belongs to the fit thread.
  const std::vector<FrameNote>& notes() const { return notes_; }
  /// Called on the fit thread after each frame; set it before any frame comes, or never.
  std::function<void()> after_frame;

 private:
  struct Tap;

  hal::Clock& clock_;
  hal::DepthCameras cameras_;
  TemporaryFolder folder_;
  daemon::FitSetup setup_;
  std::unique_ptr<daemon::Controller> controller_;
  std::unique_ptr<daemon::DdsLink> dds_;
  std::unique_ptr<Tap> tap_;
  std::unique_ptr<daemon::CloudTap> cloud_tap_;
  std::unique_ptr<daemon::Pipeline> pipeline_;
  std::vector<FrameNote> notes_;
  std::atomic<std::uint64_t> frames_{0}, heard_{0};
  std::atomic<bool> stop_{false};
  std::thread reader_;
};

}  // namespace booth::tests

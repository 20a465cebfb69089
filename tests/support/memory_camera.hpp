// A camera that plays rendered frames again and again at their own pace, from memory, and can be unplugged.
#pragma once

#include <atomic>
#include <functional>
#include <span>

#include "hal/clock.hpp"
#include "hal/depth_camera.hpp"
#include "tests/support/frame_memory.hpp"

namespace booth::tests {

/// As a device: a frame is there `delivery` after the middle of its exposure, and a reader that is late gets the newest and loses those before.
class MemoryCamera final : public hal::DepthCamera {
 public:
  /// Fills `depth` for the frame of that number in the memory; empty: the rendered image is copied.
  using Decode = std::function<void(std::size_t number, std::span<std::uint16_t> depth)>;

  /// `begin` is when the memory's first frame is taken, the same for all cameras. Memory and clock outlive the camera.
  MemoryCamera(const FrameMemory& memory, std::size_t index, hal::Clock& clock, hal::MonotonicTime begin, Decode decode = {});

  const hal::CameraDescription& description() const override { return memory_.cameras[index_]; }
  void start() override;
  void stop() noexcept override { running_ = false; }
  hal::ReadStatus read(hal::DepthFrame& slot, hal::Nanoseconds timeout) override;
  hal::CameraCounters counters() const override { return {.delivered = delivered_, .dropped = dropped_}; }
  std::string last_error() const override { return lost ? "the cable was pulled, and this sentence is longer than a small string" : ""; }

  std::atomic<bool> lost{false};

 private:
  static constexpr hal::Nanoseconds kDelivery = std::chrono::milliseconds(15);
  hal::MonotonicTime captured(std::uint64_t n) const;

  const FrameMemory& memory_;
  const std::size_t index_;
  hal::Clock& clock_;
  const hal::MonotonicTime begin_;
  const Decode decode_;
  std::uint64_t next_ = 0;
  std::atomic<std::uint64_t> delivered_{0}, dropped_{0};
  std::atomic<bool> running_{false};
};

}  // namespace booth::tests

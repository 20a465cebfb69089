// Cameras and a fitter that do exactly what a test tells them, in real or in no time.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

#include "daemon/pipeline/frame_fitter.hpp"
#include "hal/clock.hpp"
#include "hal/depth_camera.hpp"

namespace booth::tests {

/// A tiny camera at 30 frames/s with a phase. In real time it sleeps until each frame is due; otherwise frames come at once.
class FakeCamera final : public hal::DepthCamera {
 public:
  FakeCamera(std::string name, hal::Clock& clock, hal::Nanoseconds phase, std::uint64_t frames, bool real_time)
      : clock_(clock), phase_(phase), frames_(frames), real_time_(real_time) {
    description_.name = std::move(name);
    description_.intrinsics = {.width = 8, .height = 6, .fx = 8, .fy = 8, .cx = 4, .cy = 3, .distortion = {}};
  }

  const hal::CameraDescription& description() const override { return description_; }
  void start() override {
    ++starts;
    if (refuse_start) throw std::runtime_error(description_.name + " is not plugged in");
    running_ = true;
    if (real_time_) origin_ = clock_.now();
  }
  void stop() noexcept override { running_ = false; }
  hal::ReadStatus read(hal::DepthFrame& slot, hal::Nanoseconds timeout) override {
    if (!running_) return hal::ReadStatus::ended;
    if (lost) return hal::ReadStatus::lost;
    if (next_ >= frames_) return hal::ReadStatus::ended;
    const hal::MonotonicTime due =
        origin_ + phase_ + std::chrono::nanoseconds(33'333'333) * static_cast<std::int64_t>(real_time_ ? next_ - base_ : next_.load());
    if (real_time_) {
      if (due > clock_.now() + timeout) {
        clock_.sleep_until(clock_.now() + timeout);
        return hal::ReadStatus::timeout;
      }
      clock_.sleep_until(due);
    }
    slot.sequence = next_++;
    slot.captured = slot.received = due;
    slot.depth.assign(48, static_cast<std::uint16_t>(slot.sequence));
    return hal::ReadStatus::frame;
  }
  hal::CameraCounters counters() const override { return {.delivered = next_}; }
  std::string last_error() const override { return lost ? "the cable was pulled" : ""; }

  /// The device comes back after it was lost: its frames go on from now.
  void plug_in() {
    base_ = next_.load();
    lost = false;
  }

  std::atomic<bool> lost{false}, refuse_start{false};
  std::atomic<int> starts{0};

 private:
  hal::CameraDescription description_;
  hal::Clock& clock_;
  const hal::Nanoseconds phase_;
  const std::uint64_t frames_;
  const bool real_time_;
  hal::MonotonicTime origin_{std::chrono::seconds(100)};
  std::atomic<std::uint64_t> next_{0}, base_{0};
  std::atomic<bool> running_{false};
};

/// Sees a person when told to; q[0] is the frame's number.
class FakeFitter final : public daemon::FrameFitter {
 public:
  void reset() override { ++resets; }
  void step(const daemon::FitInput& input, daemon::FrameRecord& out) override {
    if (busy.count() > 0) std::this_thread::sleep_for(busy);
    for (; held; std::this_thread::sleep_for(std::chrono::milliseconds(1))) holding = true;
    out.person = there ? (input.frame == 0 ? daemon::PersonState::estimated : daemon::PersonState::tracked) : daemon::PersonState::lost;
    out.body_accepted = there && known && input.frame >= accept_at;
    out.shape_count = 1;
    out.beta[0] = shape;
    out.q[0] = static_cast<double>(input.frame);
    out.residual = 0.01f;
    out.coverage = coverage;
    ++steps;
  }
  const char* remark() const override { return there ? "" : "the stage is empty"; }
  std::vector<daemon::MemoryItem> memory_plan() const override { return {{"nothing", 0}}; }
  std::vector<daemon::CameraDriftStatus> drift() const override {
    const std::lock_guard lock(drift_mutex_);
    return drift_;
  }
  void says_of_cameras(std::vector<daemon::CameraDriftStatus> drift) {
    const std::lock_guard lock(drift_mutex_);
    drift_ = std::move(drift);
  }

  std::chrono::milliseconds busy{0};
  std::atomic<bool> held{false};     ///< step() does not return before this is false again ...
  std::atomic<bool> holding{false};  ///< ... and says here that it waits
  std::atomic<bool> there{true};
  std::atomic<bool> known{true};       ///< the body is accepted, from `accept_at` on
  std::atomic<double> shape{0};        ///< the only coefficient
  std::atomic<float> coverage{0.85f};  ///< what four cameras show of a body
  std::uint64_t accept_at = 3;
  std::atomic<int> resets{0}, steps{0};

 private:
  mutable std::mutex drift_mutex_;
  std::vector<daemon::CameraDriftStatus> drift_;
};

/// True as soon as `condition` is, false when it has not become so within the limit.
template <class F>
bool eventually(F condition, std::chrono::milliseconds limit = std::chrono::seconds(30)) {
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

}  // namespace booth::tests

// One camera's thread: reads frames into fixed slots and brings the camera back when it is lost.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "daemon/health/patient_progress.hpp"
#include "daemon/pipeline/index_ring.hpp"
#include "daemon/pipeline/wakeup.hpp"
#include "hal/clock.hpp"
#include "hal/depth_camera.hpp"

namespace booth::daemon {

enum class CameraState : std::uint8_t { starting, running, lost, ended };
const char* to_string(CameraState s);

struct CameraStatus {
  std::string name, serial, problem;
  CameraState state = CameraState::starting;
  double fps = 0;  ///< over the last second or so
  hal::CameraCounters counters;
  std::uint64_t no_slot = 0;  ///< frames lost because all slots were in use
  std::uint32_t restarts = 0;
  hal::DecodeStatus decoding;
};

/// The thread runs from construction to destruction.
class CameraWorker {
 public:
  static constexpr std::size_t kSlots = 8;

  /// `bell` is rung for every frame. The camera stays the caller's and outlives the worker.
  CameraWorker(hal::DepthCamera& camera, hal::CameraIndex index, hal::Clock& clock, Wakeup& bell);
  ~CameraWorker();
  CameraWorker(const CameraWorker&) = delete;

  /// Called by one consumer thread: a filled slot, and its return.
  bool take(int& slot) { return ready_.pop(slot); }
  void give_back(int slot) { (void)free_.push(slot); }
  const hal::DepthFrame& frame(int slot) const { return slots_[static_cast<std::size_t>(slot)]; }

  CameraState state() const { return state_.load(std::memory_order_acquire); }
  CameraStatus status() const;
  /// Moves with every turn of the thread's loop, frames or not. A device that hangs may hold up its start or stop for many seconds, and that is no reason to
  /// end the daemon: meanwhile it moves with the time, for a minute at most.
  std::uint64_t progress() const { return progress_.value(); }
  std::size_t memory_bytes() const;

 private:
  void run();
  bool start_camera();
  void stop_camera();
  void note_frame(hal::MonotonicTime now);
  void set_problem(const std::string& text);
  void pause(hal::Nanoseconds duration);

  hal::DepthCamera& camera_;
  const hal::CameraIndex index_;
  hal::Clock& clock_;
  Wakeup& bell_;
  std::vector<hal::DepthFrame> slots_;
  hal::DepthFrame spare_;  ///< read into when all slots are in use, so that the device does not stall
  IndexRing<int, kSlots> ready_, free_;
  std::atomic<CameraState> state_{CameraState::starting};
  std::atomic<std::uint64_t> no_slot_{0};
  PatientProgress progress_{clock_};
  std::atomic<std::uint32_t> restarts_{0};
  std::atomic<float> fps_{0};
  hal::MonotonicTime window_start_{};
  int window_frames_ = 0;
  mutable std::mutex problem_mutex_;
  std::string problem_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace booth::daemon

// A stage's progress counter that bears with one thing from outside, a device or a disk, which may hold its thread up for longer than the watch's patience.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>

#include "hal/clock.hpp"

namespace booth::daemon {

/// Moves with every turn of its stage; while the stage is Busy it moves with the time, for a minute at most: then the thread hangs (ProgressWatch).
/// turn() and Busy are the stage's thread's, value() may be called from any.
class PatientProgress {
 public:
  explicit PatientProgress(const hal::Clock& clock) : clock_(clock) {}

  void turn() { turns_.fetch_add(1, std::memory_order_relaxed); }
  std::uint64_t value() const {
    const std::uint64_t turns = turns_.load(std::memory_order_relaxed);
    const auto since = busy_since_.load(std::memory_order_relaxed);
    if (since == 0) return turns;
    const auto busy = clock_.now() - hal::MonotonicTime(hal::Nanoseconds(since));
    return turns + static_cast<std::uint64_t>(std::clamp<std::int64_t>(busy / kStep, 0, kPatience / kStep));
  }

  /// While it lives, the stage waits for something from outside.
  class Busy {
   public:
    explicit Busy(PatientProgress& progress) : progress_(progress) { progress_.busy_since_ = progress_.clock_.now().time_since_epoch().count(); }
    ~Busy() { progress_.busy_since_ = 0; }
    Busy(const Busy&) = delete;

   private:
    PatientProgress& progress_;
  };

 private:
  static constexpr hal::Nanoseconds kPatience = std::chrono::minutes(1), kStep = std::chrono::milliseconds(100);

  const hal::Clock& clock_;
  std::atomic<std::uint64_t> turns_{0};
  std::atomic<std::int64_t> busy_since_{0};  ///< monotonic nanoseconds; 0: not waiting
};

}  // namespace booth::daemon

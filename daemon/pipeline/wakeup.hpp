// A bell between threads: rung when there is something to look at, heard at once or within a time limit.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>

namespace booth::daemon {

/// Thread-safe. Rings between two waits are remembered as one.
class Wakeup {
 public:
  void ring() {
    {
      const std::lock_guard lock(mutex_);
      rung_ = true;
    }
    condition_.notify_one();
  }

  /// False when nobody rang within the limit.
  bool wait(std::chrono::nanoseconds limit) {
    std::unique_lock lock(mutex_);
    const bool heard = condition_.wait_for(lock, limit, [&] { return rung_; });
    rung_ = false;
    return heard;
  }

 private:
  std::mutex mutex_;
  std::condition_variable condition_;
  bool rung_ = false;
};

}  // namespace booth::daemon

// The devices of one process share the driver's context: a lost one is mended by a reset that takes the others' memory away, and they must neither be in the
// middle of a call then, nor go on afterwards as if nothing had been.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace booth::gpu {

/// Thread-safe. A generation is the time between two resets.
class ResetGate {
 public:
  /// For who opens a device, and holds nothing: calls `reset` first where a device of this generation was lost. What it opens then belongs to the generation
  /// that is returned.
  template <class Reset>
  std::uint64_t open(const Reset& reset) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return !resetting_; });
    if (!lost_) return generation_;
    resetting_ = true;  // from here on nobody new gets in: users that follow each other closely would keep a reset waiting for ever
    changed_.wait(lock, [&] { return holds_ == 0; });
    reset();
    ++generation_;
    lost_ = resetting_ = false;
    changed_.notify_all();
    return generation_;
  }
  /// A device of this generation is lost: who opens one next resets first. Nothing happens where that was done already.
  void lose(std::uint64_t generation) {
    const std::lock_guard lock(mutex_);
    lost_ = lost_ || generation == generation_;
  }

  /// While a user keeps one, no reset happens. One thread keeps one at a time.
  class Hold {
   public:
    Hold(ResetGate& gate, std::uint64_t generation) : gate_(gate) {
      std::unique_lock lock(gate_.mutex_);
      gate_.changed_.wait(lock, [&] { return !gate_.resetting_; });
      ++gate_.holds_;
      good_ = generation == gate_.generation_;
    }
    ~Hold() {
      const std::lock_guard lock(gate_.mutex_);
      if (--gate_.holds_ == 0) gate_.changed_.notify_all();
    }
    Hold(const Hold&) = delete;
    /// False: there was a reset, and nothing that the device had is there any more.
    explicit operator bool() const { return good_; }

   private:
    ResetGate& gate_;
    bool good_ = false;
  };

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t generation_ = 0;
  int holds_ = 0;
  bool lost_ = false, resetting_ = false;
};

}  // namespace booth::gpu

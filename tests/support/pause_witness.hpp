// A thread that only sleeps, to tell what the machine withheld from what a program under test took too long for.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <thread>

namespace booth::tests {

/// A virtual machine can lose its processors for a while: then every thread stands still, real-time ones too, and nothing computes. This one wakes from naps
/// and counts those that lasted `pause` longer than asked. A busy machine delays it as well, but a thread that hardly computes goes first among equals.
/// The getters may be called from any thread.
class PauseWitness {
 public:
  using Clock = std::chrono::steady_clock;

  /// `after_nap`, where given, is called on the witness's thread after every nap with the nap's end and whether it was a pause.
  PauseWitness(Clock::duration nap, Clock::duration pause, std::function<void(Clock::time_point, bool)> after_nap = {})
      : nap_(nap), pause_(pause), after_nap_(std::move(after_nap)), thread_([this] { watch(); }) {}
  ~PauseWitness() {
    stop_ = true;
    thread_.join();
  }
  PauseWitness(const PauseWitness&) = delete;
  PauseWitness& operator=(const PauseWitness&) = delete;

  int pauses() const { return pauses_; }
  double longest() const { return longest_; }  ///< s beyond the nap

 private:
  void watch() {
    for (auto last = Clock::now(); !stop_;) {
      std::this_thread::sleep_for(nap_);
      const auto now = Clock::now();
      const auto late = now - last - nap_;
      last = now;
      pauses_ += late > pause_;
      longest_ = std::max(longest_.load(), std::chrono::duration<double>(late).count());
      if (after_nap_) after_nap_(now, late > pause_);
    }
  }

  const Clock::duration nap_, pause_;
  const std::function<void(Clock::time_point, bool)> after_nap_;
  std::atomic<bool> stop_{false};
  std::atomic<int> pauses_{0};
  std::atomic<double> longest_{0};
  std::thread thread_;
};

}  // namespace booth::tests

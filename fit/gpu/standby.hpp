// Keeps a device's worker for who has a substitute: when the device fails the substitute works, and the device is tried again in the background.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "fit/gpu/device_report.hpp"

namespace booth::gpu {

/// Starts a device's worker; null where that fails, `why` then says it in a sentence. Called on a thread of its own, one call at a time. Must not throw.
template <class Worker>
using StartDevice = std::function<std::unique_ptr<Worker>(std::string& why)>;

/// `Worker` has `name()`, whose answer converts to std::string. report() may be called from any thread, everything else from one at a time.
template <class Worker>
class Standby {
 public:
  /// Tries to start the device once, here, so that a working one serves from the first frame on; then, while there is none, in the background.
  Standby(std::string substitute, StartDevice<Worker> start, const GuardSettings& settings)
      : substitute_(std::move(substitute)), start_(std::move(start)), settings_(settings), wait_(settings.first_wait) {
    report_.wanted = true;
    device_ = start_(report_.problem);
    report_.attempts = 1;
    describe(device_ != nullptr);
    report_.changes = 0;
    thread_ = std::thread([this] { look_after(); });
  }
  ~Standby() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    bell_.notify_all();
    thread_.join();
  }
  Standby(const Standby&) = delete;

  /// The device's worker; null while there is none.
  Worker* current() const { return device_.get(); }
  /// At the start of a frame: the same, and a new one is taken over where there is one.
  Worker* take() {
    if (device_ || !fresh_there_.load(std::memory_order_acquire)) return device_.get();
    const std::lock_guard lock(mutex_);
    device_ = std::move(fresh_);
    fresh_there_ = false;
    report_.problem.clear();
    describe(true);
    return device_.get();
  }
  /// The current one has failed; current() is null from here on. Taking it apart may take long, so the other thread does that.
  void lose(const char* why) {
    const std::lock_guard lock(mutex_);
    dead_ = std::move(device_);
    ++report_.losses;
    report_.problem = std::string("the device failed in mid-run (") + why + "); the CPU has taken over";
    describe(false);
    bell_.notify_all();
  }
  DeviceReport report() const {
    const std::lock_guard lock(mutex_);
    return report_;
  }

 private:
  using Clock = std::chrono::steady_clock;

  /// Under the mutex, or before the thread runs.
  void describe(bool used) {
    report_.changes += used != report_.used;
    report_.used = used;
    report_.name = used ? std::string(device_->name()) : substitute_;
  }

  void look_after() {
    std::unique_lock lock(mutex_);
    while (!stop_) {
      if (dead_) {
        auto dead = std::move(dead_);
        lock.unlock();
        dead.reset();
        lock.lock();
        continue;
      }
      if (report_.used || fresh_there_) {
        if (report_.used) good_since_ = good_since_ == Clock::time_point{} ? Clock::now() : good_since_;
        bell_.wait(lock);
        continue;
      }
      // A device that worked for a while deserves a quick second try; one that fails again and again does not.
      if (good_since_ != Clock::time_point{} && Clock::now() - good_since_ > settings_.longest_wait) wait_ = settings_.first_wait;
      good_since_ = {};
      if (bell_.wait_for(lock, wait_, [&] { return stop_ || dead_ != nullptr; })) continue;
      wait_ = std::min(2 * wait_, settings_.longest_wait);
      lock.unlock();
      std::string why;
      auto fresh = start_(why);
      lock.lock();
      ++report_.attempts;
      if (fresh) {
        fresh_ = std::move(fresh);
        fresh_there_.store(true, std::memory_order_release);
      } else {
        report_.problem = why;
      }
    }
  }

  const std::string substitute_;
  const StartDevice<Worker> start_;
  const GuardSettings settings_;
  std::unique_ptr<Worker> device_;
  mutable std::mutex mutex_;  ///< guards what follows
  std::condition_variable bell_;
  std::unique_ptr<Worker> fresh_, dead_;
  std::atomic<bool> fresh_there_{false};
  std::chrono::milliseconds wait_;
  Clock::time_point good_since_{};
  DeviceReport report_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace booth::gpu

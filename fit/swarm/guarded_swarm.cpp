// Two back-ends and a thread that starts devices; a new one is handed over through one pointer, between two frames.
#include "fit/swarm/guarded_swarm.hpp"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

namespace booth::fit {
namespace {

class Guarded final : public GuardedSwarm {
 public:
  Guarded(std::unique_ptr<SwarmBackend> cpu, DeviceStart start, const GuardSettings& settings)
      : cpu_(std::move(cpu)), start_(std::move(start)), settings_(settings), wait_(settings.first_wait) {
    report_.wanted = true;
    device_ = start_(report_.problem);
    report_.attempts = 1;
    describe(device_ != nullptr);
    report_.changes = 0;
    thread_ = std::thread([this] { look_after(); });
  }
  ~Guarded() override {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    bell_.notify_all();
    thread_.join();
  }

  const char* name() const override { return device_ ? device_->name() : cpu_->name(); }
  int dimensions(int model) const override { return cpu_->dimensions(model); }
  const SwarmSettings& settings() const override { return cpu_->settings(); }
  std::size_t memory_bytes() const override { return cpu_->memory_bytes() + (device_ ? device_->memory_bytes() : 0); }

  bool set_cloud(const Cloud& cloud) override {
    take_new_device();
    cloud_ = &cloud;
    if (device_ && !device_->set_cloud(cloud)) lose();
    return device_ != nullptr || cpu_->set_cloud(cloud);
  }

  bool minimise(int model, std::span<const float> centres, std::span<const float> deviation, const RandomKey& key, SwarmResult& out) override {
    if (device_) {
      if (device_->minimise(model, centres, deviation, key, out)) return true;
      if (!take_over()) return false;
    }
    return cpu_->minimise(model, centres, deviation, key, out);
  }

  bool evaluate(int model, std::span<const float> particle, ParticleTerms& out) override {
    if (device_) {
      if (device_->evaluate(model, particle, out)) return true;
      if (!take_over()) return false;
    }
    return cpu_->evaluate(model, particle, out);
  }

  DeviceReport report() const override {
    const std::lock_guard lock(mutex_);
    return report_;
  }

 private:
  /// The frame's cloud is still the caller's: the CPU goes on with the same frame.
  bool take_over() {
    lose();
    return cloud_ == nullptr || cpu_->set_cloud(*cloud_);
  }

  /// Taking a lost device apart may take long, so the other thread does that.
  void lose() {
    const std::lock_guard lock(mutex_);
    dead_ = std::move(device_);
    ++report_.losses;
    report_.problem = "the device failed in mid-run; the CPU has taken over";
    describe(false);
    bell_.notify_all();
  }

  void take_new_device() {
    if (device_ || !fresh_there_.load(std::memory_order_acquire)) return;
    const std::lock_guard lock(mutex_);
    device_ = std::move(fresh_);
    fresh_there_ = false;
    report_.problem.clear();
    describe(true);
  }

  /// Under the mutex, or before the thread runs.
  void describe(bool used) {
    report_.changes += used != report_.used;
    report_.used = used;
    report_.name = used ? device_->name() : cpu_->name();
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

  using Clock = std::chrono::steady_clock;
  std::unique_ptr<SwarmBackend> cpu_, device_;
  DeviceStart start_;
  GuardSettings settings_;
  const Cloud* cloud_ = nullptr;
  mutable std::mutex mutex_;  ///< guards what follows
  std::condition_variable bell_;
  std::unique_ptr<SwarmBackend> fresh_, dead_;
  std::atomic<bool> fresh_there_{false};
  std::chrono::milliseconds wait_;
  Clock::time_point good_since_{};
  DeviceReport report_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace

std::unique_ptr<GuardedSwarm> make_guarded_swarm(std::unique_ptr<SwarmBackend> cpu, DeviceStart start, const GuardSettings& settings) {
  return std::make_unique<Guarded>(std::move(cpu), std::move(start), settings);
}

}  // namespace booth::fit

// Two back-ends, and which of them a call goes to.
#include "fit/swarm/guarded_swarm.hpp"

#include <utility>

namespace booth::fit {
namespace {

class Guarded final : public GuardedSwarm {
 public:
  Guarded(std::unique_ptr<SwarmBackend> cpu, DeviceStart start, const GuardSettings& settings)
      : cpu_(std::move(cpu)), standby_(cpu_->name(), std::move(start), settings) {}

  const char* name() const override { return now().name(); }
  const char* problem() const override { return now().problem(); }
  int dimensions(int model) const override { return cpu_->dimensions(model); }
  const SwarmSettings& settings() const override { return now().settings(); }
  std::size_t memory_bytes() const override { return cpu_->memory_bytes() + (standby_.current() ? standby_.current()->memory_bytes() : 0); }

  bool set_cloud(const Cloud& cloud) override {
    cloud_ = &cloud;
    if (SwarmBackend* device = standby_.take()) {
      if (device->set_cloud(cloud)) return true;
      standby_.lose(device->problem());
    }
    return cpu_->set_cloud(cloud);
  }

  bool minimise(int model, std::span<const float> centres, std::span<const float> deviation, const RandomKey& key, SwarmResult& out) override {
    if (SwarmBackend* device = standby_.current()) {
      if (device->minimise(model, centres, deviation, key, out)) return true;
      if (!take_over(*device)) return false;
    }
    return cpu_->minimise(model, centres, deviation, key, out);
  }

  bool evaluate(int model, std::span<const float> particle, ParticleTerms& out) override {
    if (SwarmBackend* device = standby_.current()) {
      if (device->evaluate(model, particle, out)) return true;
      if (!take_over(*device)) return false;
    }
    return cpu_->evaluate(model, particle, out);
  }

  DeviceReport report() const override { return standby_.report(); }

 private:
  const SwarmBackend& now() const { return standby_.current() ? *standby_.current() : *cpu_; }

  /// The frame's cloud is still the caller's: the CPU goes on with the same frame.
  bool take_over(const SwarmBackend& device) {
    standby_.lose(device.problem());
    return cloud_ == nullptr || cpu_->set_cloud(*cloud_);
  }

  std::unique_ptr<SwarmBackend> cpu_;
  gpu::Standby<SwarmBackend> standby_;
  const Cloud* cloud_ = nullptr;
};

}  // namespace

std::unique_ptr<GuardedSwarm> make_guarded_swarm(std::unique_ptr<SwarmBackend> cpu, DeviceStart start, const GuardSettings& settings) {
  return std::make_unique<Guarded>(std::move(cpu), std::move(start), settings);
}

}  // namespace booth::fit

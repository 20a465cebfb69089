// The swarm on the CPU: groups of particles are tasks, the best particle is sought in index order.
#include <algorithm>
#include <limits>
#include <stdexcept>

#include "fit/swarm/backend.hpp"
#include "fit/swarm/lanes.hpp"
#include "fit/swarm/swarm_kernel.hpp"

namespace booth::fit {
namespace {

const SwarmKernel& choose(const std::string& name) {
  int count = 0;
  const SwarmKernel* all = swarm_kernels(count);
  for (int k = count - 1; k >= 0; --k)
    if (name.empty() ? all[k].available() : name == all[k].name) {
      if (!all[k].available()) throw std::invalid_argument("swarm: this processor cannot run the kernel '" + name + "'");
      return all[k];
    }
  std::string names;
  for (int k = 0; k < count; ++k) names += std::string(k ? ", " : "") + all[k].name;
  throw std::invalid_argument("swarm: there is no kernel '" + name + "'; there are " + names);
}

class CpuSwarm final : public SwarmBackend {
 public:
  CpuSwarm(std::span<const BodyModel* const> models, const PosePrior& prior, const SwarmSizes& sizes, WorkerPool& pool, const std::string& kernel)
      : settings_(sizes.swarm), pool_(pool), kernel_(choose(kernel)), name_(std::string("cpu ") + kernel_.name), field_(sizes.field) {
    const auto need = [](bool good, const char* what) {
      if (!good) throw std::invalid_argument(std::string("swarm: ") + what);
    };
    need(!models.empty(), "there is no model");
    need(settings_.particles >= 1 && settings_.particles <= 1'000'000, "particles must be 1 to 1000000");
    need(settings_.iterations >= 1 && settings_.iterations <= 10'000, "iterations must be 1 to 10000");
    int dimensions = 0;
    for (const BodyModel* model : models) {
      packs_.emplace_back(*model, prior, sizes.energy);
      dimensions = std::max(dimensions, packs_.back().dimensions());
    }
    groups_ = (settings_.particles + kGroup - 1) / kGroup;
    // Two threads should have as much to do: an even number.
    blocks_ = std::min(groups_, ((groups_ + kMostGroups - 1) / kMostGroups + 1) / 2 * 2);
    const auto floats = static_cast<std::size_t>(groups_) * static_cast<std::size_t>(dimensions * kGroup);
    for (auto* v : {&position_, &velocity_, &best_}) v->resize(floats);
    best_cost_.resize(static_cast<std::size_t>(groups_ * kGroup));
    global_.resize(static_cast<std::size_t>(dimensions));
    history_.resize(static_cast<std::size_t>(settings_.iterations));
  }

  const char* name() const override { return name_.c_str(); }

  bool set_cloud(const Cloud& cloud) override {
    field_.rebuild(cloud, pool_);
    return true;
  }

  bool minimise(int model, std::span<const float> centres, std::span<const float> deviation, const RandomKey& key, SwarmResult& out) override {
    const EnergyPack& pack = packs_[static_cast<std::size_t>(model)];
    const int d = pack.dimensions();
    SwarmWork work{pack.batch_view(), field_.view(),    {},           centres.data(),   deviation.data(), global_.data(),
                   position_.data(),  velocity_.data(), best_.data(), best_cost_.data()};
    work.step.key = key;
    work.step.starts = static_cast<int>(centres.size()) / d;
    work.step.cognitive = settings_.cognitive, work.step.social = settings_.social;
    float least = std::numeric_limits<float>::max();
    for (int iteration = 0; iteration < settings_.iterations; ++iteration) {
      work.step.iteration = iteration;
      work.step.inertia = inertia_of(iteration, settings_.iterations, settings_.inertia_first, settings_.inertia_last);
      pool_.run(blocks_, [&](int block) {
        const Range r = block_range(groups_, blocks_, block);
        kernel_.run(work, r.begin, r.end);
      });
      int winner = -1;
      for (int p = 0; p < settings_.particles; ++p)
        if (best_cost_[static_cast<std::size_t>(p)] < least) least = best_cost_[static_cast<std::size_t>(p)], winner = p;
      if (winner >= 0) {
        const float* from = best_.data() + static_cast<std::size_t>(winner / kGroup) * static_cast<std::size_t>(d * kGroup) + winner % kGroup;
        for (int k = 0; k < d; ++k) global_[static_cast<std::size_t>(k)] = from[k * kGroup];
      }
      history_[static_cast<std::size_t>(iteration)] = least;
    }
    out.best = {global_.data(), static_cast<std::size_t>(d)};
    out.cost = least;
    out.history = history_;
    return true;
  }

  bool evaluate(int model, std::span<const float> particle, ParticleTerms& out) override {
    LaneTerms<ScalarLanes> terms;
    particle_energy<ScalarLanes, 0>(packs_[static_cast<std::size_t>(model)].view(), field_.view(), particle.data(), 1, terms);
    out = {terms.point, terms.plane, terms.shape, terms.bone, terms.pose};
    return true;
  }

  int dimensions(int model) const override { return packs_[static_cast<std::size_t>(model)].dimensions(); }
  const SwarmSettings& settings() const override { return settings_; }
  std::size_t memory_bytes() const override {
    std::size_t bytes = field_.memory_bytes() + (position_.size() * 3 + best_cost_.size() + global_.size() + history_.size()) * sizeof(float);
    for (const EnergyPack& p : packs_) bytes += p.memory_bytes();
    return bytes;
  }

 private:
  SwarmSettings settings_;
  WorkerPool& pool_;
  const SwarmKernel& kernel_;
  std::string name_;
  CellField field_;
  std::vector<EnergyPack> packs_;
  int groups_ = 0, blocks_ = 0;
  std::vector<float> position_, velocity_, best_, best_cost_, global_, history_;
};

}  // namespace

std::unique_ptr<SwarmBackend> make_cpu_swarm(std::span<const BodyModel* const> models, const PosePrior& prior, const SwarmSizes& sizes, WorkerPool& pool,
                                             const std::string& kernel) {
  return std::make_unique<CpuSwarm>(models, prior, sizes, pool, kernel);
}

}  // namespace booth::fit

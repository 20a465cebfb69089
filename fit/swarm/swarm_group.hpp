// One iteration of a group of particles, for any set of lanes: each kernel's source file instantiates it with its own.
#pragma once

#include "fit/swarm/swarm_kernel.hpp"

namespace booth::fit {

/// The kLanes particles of the group from lane `offset` on.
template <class L, int kPairs>
BOOTH_HOST_DEVICE void run_lanes(const SwarmWork& w, int group, int offset) {
  using F = typename L::F;
  const int d = w.energy.dimensions();
  const std::int64_t at = static_cast<std::int64_t>(group) * d * kGroup + offset;
  float* position = w.position + at;
  float* velocity = w.velocity + at;
  float* best = w.best + at;
  const std::uint32_t first = static_cast<std::uint32_t>(group * kGroup + offset);
  const typename L::U particle = L::count_from(first);
  for (int k = 0; k < d; ++k) {
    F x, v;
    if (w.step.iteration == 0) {
      float centre[L::kCount];
      for (int lane = 0; lane < L::kCount; ++lane)
        centre[lane] = w.centres[static_cast<int>((first + static_cast<unsigned>(lane)) % static_cast<unsigned>(w.step.starts)) * d + k];
      start_dimension<L>(w.step, particle, static_cast<std::uint32_t>(k), L::load(centre), w.deviation[k], x, v);
    } else {
      x = L::load(position + k * kGroup), v = L::load(velocity + k * kGroup);
      move_dimension<L>(w.step, particle, static_cast<std::uint32_t>(k), L::load(best + k * kGroup), w.global[k], w.deviation[k], x, v);
    }
    L::store(position + k * kGroup, x), L::store(velocity + k * kGroup, v);
  }
  LaneTerms<L> terms;
  particle_energy<L, kPairs>(w.energy, w.field, position, kGroup, terms);
  const F cost = total_energy<L>(w.energy, terms);
  float* best_cost = w.best_cost + group * kGroup + offset;
  if (w.step.iteration == 0) {
    L::store(best_cost, cost);
    for (int k = 0; k < d; ++k) L::store(best + k * kGroup, L::load(position + k * kGroup));
    return;
  }
  const F old = L::load(best_cost);
  const auto better = cost < old;
  L::store(best_cost, better ? cost : old);
  for (int k = 0; k < d; ++k) L::store(best + k * kGroup, better ? L::load(position + k * kGroup) : L::load(best + k * kGroup));
}

template <class L>
BOOTH_HOST_DEVICE void run_group(const SwarmWork& w, int group) {
  for (int offset = 0; offset < kGroup; offset += L::kCount) {
    if (w.energy.pairs == 8)
      run_lanes<L, 8>(w, group, offset);
    else
      run_lanes<L, 0>(w, group, offset);
  }
}

}  // namespace booth::fit

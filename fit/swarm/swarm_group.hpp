// One iteration of some groups of particles, for any set of lanes: each kernel's source file instantiates it with its own.
#pragma once

#include "fit/swarm/swarm_kernel.hpp"

namespace booth::fit {

/// Moves (iteration 0: places) the particles of the group from lane `offset` on, as many as L has lanes.
template <class L, class Field>
BOOTH_HOST_DEVICE void move_lanes(const SwarmWorkOver<Field>& w, int group, int offset) {
  using F = typename L::F;
  const int d = w.energy.model.dimensions();
  const std::int64_t at = static_cast<std::int64_t>(group) * d * kGroup + offset;
  const std::uint32_t first = static_cast<std::uint32_t>(group * kGroup + offset);
  const typename L::U particle = L::count_from(first);
  typename L::U words[kDrawnTogether];
  for (int k = 0; k < d; ++k) {
    const std::uint32_t dimension = static_cast<std::uint32_t>(k);
    if (dimension % kDrawnTogether == 0) move_words<L>(w.step.key, w.step.iteration, particle, dimension / kDrawnTogether, words);
    const typename L::U word = words[dimension % kDrawnTogether];
    F x, v;
    float* position = w.position + at + k * kGroup;
    float* velocity = w.velocity + at + k * kGroup;
    if (w.step.iteration == 0) {
      float centre[L::kCount];
      for (int lane = 0; lane < L::kCount; ++lane)
        centre[lane] = w.centres[static_cast<int>((first + static_cast<unsigned>(lane)) % static_cast<unsigned>(w.step.starts)) * d + k];
      start_dimension<L>(w.step, particle, dimension, word, L::load(centre), w.deviation[k], x, v);
    } else {
      x = L::load(position), v = L::load(velocity);
      move_dimension<L>(w.step, word, L::load(w.best + at + k * kGroup), w.global[k], w.deviation[k], x, v);
    }
    L::store(position, x), L::store(velocity, v);
  }
}

/// Keeps what is better than before.
template <class L, class Field>
BOOTH_HOST_DEVICE void keep_best(const SwarmWorkOver<Field>& w, int group, int offset, typename L::F cost) {
  const int d = w.energy.model.dimensions();
  const std::int64_t at = static_cast<std::int64_t>(group) * d * kGroup + offset;
  const float* position = w.position + at;
  float* best = w.best + at;
  float* best_cost = w.best_cost + group * kGroup + offset;
  if (w.step.iteration == 0) {
    L::store(best_cost, cost);
    for (int k = 0; k < d; ++k) L::store(best + k * kGroup, L::load(position + k * kGroup));
    return;
  }
  const typename L::F old = L::load(best_cost);
  const auto better = cost < old;
  L::store(best_cost, better ? cost : old);
  for (int k = 0; k < d; ++k) L::store(best + k * kGroup, better ? L::load(position + k * kGroup) : L::load(best + k * kGroup));
}

/// The reference: one particle at a time, as fit/energy/particle_energy.hpp says.
template <class Field>
BOOTH_HOST_DEVICE void run_reference(const SwarmWorkOver<Field>& w, int first, int last) {
  using L = ScalarLanes;
  const EnergyView& m = w.energy.model;
  for (int p = first * kGroup; p < last * kGroup; ++p) {
    const int group = p / kGroup, offset = p % kGroup;
    move_lanes<L>(w, group, offset);
    LaneTerms<L> terms;
    particle_energy<L, 0>(m, w.field, w.position + static_cast<std::int64_t>(group) * m.dimensions() * kGroup + offset, kGroup, terms);
    keep_best<L>(w, group, offset, total_energy<L>(m, terms));
  }
}

/// A vector kernel: fit/energy/batch_energy.hpp. At most kTogether / kGroup groups.
template <class L, int kQuads>
BOOTH_HOST_DEVICE void run_groups(const SwarmWork& w, int first, int last) {
  constexpr int kInGroup = kGroup / L::kCount;
  const EnergyView& m = w.energy.model;
  const int turns = (last - first) * kInGroup;
  const auto group = [&](int turn) { return first + turn / kInGroup; };
  const auto offset = [&](int turn) { return turn % kInGroup * L::kCount; };
  for (int u = 0; u < turns; ++u) move_lanes<L>(w, group(u), offset(u));
  particle_energies<L, kQuads>(
      w.energy, w.field, turns, kGroup, [&](int u) { return w.position + static_cast<std::int64_t>(group(u)) * m.dimensions() * kGroup + offset(u); },
      [&](int u, const LaneTerms<L>& terms) { keep_best<L>(w, group(u), offset(u), total_energy<L>(m, terms)); });
}

}  // namespace booth::fit

// What the CPU back-end's kernels share: the particles' memory and one function that takes a group of them through an iteration.
#pragma once

#include <cstdint>

#include "fit/cloud/cell_view.hpp"
#include "fit/energy/batch_energy.hpp"
#include "fit/swarm/move.hpp"

namespace booth::fit {

inline constexpr int kGroup = 16;  ///< particles whose data lies side by side: [group][dimension][particle]

/// Plain pointers only: a function template of the standard library that were compiled for one processor could be linked into the code for another.
template <class Field>
struct SwarmWorkOver {
  BatchView energy;
  Field field;
  MoveStep step;
  const float *centres, *deviation, *global;  ///< whole vectors
  float *position, *velocity, *best;          ///< [group][dimension][kGroup]
  float* best_cost;                           ///< [group][kGroup]
};

using SwarmWork = SwarmWorkOver<CellView>;

/// Moves (iteration 0: places) the particles of the groups [first, last), evaluates them and keeps each one's best; at most kMostGroups groups.
using SwarmKernelFunction = void(const SwarmWork& work, int first, int last);
inline constexpr int kMostGroups = kTogether / kGroup;

struct SwarmKernel {
  const char* name;
  SwarmKernelFunction* run;
  bool (*available)();
};

/// From the simplest to the best: "scalar" is always there and first.
const SwarmKernel* swarm_kernels(int& count);

}  // namespace booth::fit

// What the CPU back-end's kernels share: the particles' memory and one function that takes a group of them through an iteration.
#pragma once

#include <cstdint>

#include "fit/cloud/field_view.hpp"
#include "fit/energy/particle_energy.hpp"
#include "fit/swarm/move.hpp"

namespace booth::fit {

inline constexpr int kGroup = 16;  ///< particles whose data lies side by side: [group][dimension][particle]

/// Plain pointers only: a function template of the standard library that were compiled for one processor could be linked into the code for another.
struct SwarmWork {
  EnergyView energy;
  FieldView field;
  MoveStep step;
  const float *centres, *deviation, *global;  ///< whole vectors
  float *position, *velocity, *best;          ///< [group][dimension][kGroup]
  float* best_cost;                           ///< [group][kGroup]
};

/// Moves (iteration 0: places) the group's particles, evaluates them and keeps each one's best.
using SwarmKernelFunction = void(const SwarmWork& work, int group);

struct SwarmKernel {
  const char* name;
  SwarmKernelFunction* run;
  bool (*available)();
};

/// From the simplest to the best: "scalar" is always there and first.
const SwarmKernel* swarm_kernels(int& count);

}  // namespace booth::fit

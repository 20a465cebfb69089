// The reference kernel: the single-source functions, one particle at a time, and the list of all kernels.
#include "fit/swarm/lanes.hpp"
#include "fit/swarm/swarm_group.hpp"

namespace booth::fit {
namespace {

void run_scalar(const SwarmWork& work, int group) { run_group<ScalarLanes>(work, group); }

constexpr SwarmKernel kKernels[] = {{"scalar", run_scalar, [] { return true; }}};

}  // namespace

const SwarmKernel* swarm_kernels(int& count) {
  count = static_cast<int>(sizeof kKernels / sizeof kKernels[0]);
  return kKernels;
}

}  // namespace booth::fit

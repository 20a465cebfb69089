// The reference kernel: the single-source functions, one particle at a time, and the list of all kernels.
#include "fit/swarm/lanes.hpp"
#include "fit/swarm/swarm_group.hpp"

namespace booth::fit {

// kernel_vector.cpp, once for each instruction set.
SwarmKernelFunction run_baseline, run_avx2, run_avx512;

namespace {

void run_scalar(const SwarmWork& work, int first, int last) { run_reference(work, first, last); }

constexpr SwarmKernel kKernels[] = {
    {"scalar", run_scalar, [] { return true; }},
    {"baseline", run_baseline, [] { return true; }},  // what every processor of the architecture has: SSE2, NEON
#if defined(__x86_64__)
    {"avx2", run_avx2, [] { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }},
    {"avx512", run_avx512,
     [] {
       return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
              __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512vnni");
     }},
#endif
};

}  // namespace

const SwarmKernel* swarm_kernels(int& count) {
  count = static_cast<int>(sizeof kKernels / sizeof kKernels[0]);
  return kKernels;
}

}  // namespace booth::fit

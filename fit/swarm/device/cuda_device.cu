// The swarm's kernels, compiled for CUDA devices.
#include "fit/swarm/device/cuda_device.hpp"
#include "fit/gpu/cuda_device.cuh"

namespace booth::fit::device {

bool cuda_built_in() { return true; }

std::unique_ptr<Device> make_cuda_device(std::string& why) { return gpu::open_cuda_device<Kernels>(gpu::Waiting::busily, why); }

}  // namespace booth::fit::device

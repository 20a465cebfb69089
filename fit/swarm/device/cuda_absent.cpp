// Stands in for the CUDA device in builds without CUDA.
#include "fit/swarm/device/cuda_device.hpp"

namespace booth::fit::device {

bool cuda_built_in() { return false; }

std::unique_ptr<Device> make_cuda_device(std::string& why) {
  why = "this build has no CUDA back-end; build it with -DBOOTHD_CUDA=ON (docs/guide/gpu.md)";
  return nullptr;
}

}  // namespace booth::fit::device

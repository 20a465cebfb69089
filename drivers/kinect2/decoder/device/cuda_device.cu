// The decode's kernels, compiled for CUDA devices.
#include "drivers/kinect2/decoder/device/device.hpp"
#include "fit/gpu/cuda_device.cuh"

namespace booth::drivers::kinect2::device {

// One thread a camera waits: they must not take the processors from the fit.
std::unique_ptr<Device> make_cuda_device(std::string& why) { return gpu::open_cuda_device<Kernels>(gpu::Waiting::napping, why); }

}  // namespace booth::drivers::kinect2::device

// Stands in for the CUDA device in builds without CUDA.
#include "drivers/kinect2/decoder/device/device.hpp"

namespace booth::drivers::kinect2::device {

std::unique_ptr<Device> make_cuda_device(std::string& why) {
  why = "this build has no CUDA; build it with -DBOOTHD_CUDA=ON (docs/guide/gpu.md)";
  return nullptr;
}

}  // namespace booth::drivers::kinect2::device

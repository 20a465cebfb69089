// The decode's kernels as one set, and the devices that they run on.
#pragma once

#include <memory>
#include <string>
#include <variant>

#include "drivers/kinect2/decoder/device/kernels.hpp"
#include "fit/gpu/device.hpp"

namespace booth::drivers::kinect2::device {

struct Kernels {
  using Any = std::variant<MeasurePhases, FilterPhases, AcceptDepth>;
};
using Device = gpu::Device<Kernels>;
using Step = gpu::Step<Kernels>;

/// The first CUDA device of this machine; null where there is none, or where this build has no CUDA: `why` then says it in a sentence.
std::unique_ptr<Device> make_cuda_device(std::string& why);

}  // namespace booth::drivers::kinect2::device

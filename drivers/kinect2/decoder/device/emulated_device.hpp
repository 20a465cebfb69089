// The decode's kernels on the host, for tests and machines without a graphics processor.
#pragma once

#include <memory>

#include "drivers/kinect2/decoder/device/device.hpp"
#include "fit/gpu/emulated_device.hpp"

namespace booth::drivers::kinect2::device {

/// `faults` outlives the device.
std::unique_ptr<Device> make_emulated_device(gpu::Faults& faults, int processors = 8);

}  // namespace booth::drivers::kinect2::device

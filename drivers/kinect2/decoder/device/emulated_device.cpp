// The one place where the emulator is compiled with the decode's kernels.
#include "drivers/kinect2/decoder/device/emulated_device.hpp"

namespace booth::drivers::kinect2::device {

std::unique_ptr<Device> make_emulated_device(gpu::Faults& faults, int processors) { return std::make_unique<gpu::EmulatedDevice<Kernels>>(faults, processors); }

}  // namespace booth::drivers::kinect2::device

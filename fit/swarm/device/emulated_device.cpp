// The one place where the emulator is compiled with the swarm's kernels.
#include "fit/swarm/device/emulated_device.hpp"

namespace booth::fit::device {

std::unique_ptr<Device> make_emulated_device(Faults& faults, int processors) { return std::make_unique<gpu::EmulatedDevice<Kernels>>(faults, processors); }

}  // namespace booth::fit::device

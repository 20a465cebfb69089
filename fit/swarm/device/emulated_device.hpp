// The swarm's kernels on the host, for tests and machines without a graphics processor.
#pragma once

#include <memory>

#include "fit/gpu/emulated_device.hpp"
#include "fit/swarm/device/device.hpp"

namespace booth::fit::device {

using gpu::Faults;
using gpu::Order;

/// `faults` outlives the device.
std::unique_ptr<Device> make_emulated_device(Faults& faults, int processors = 8);

}  // namespace booth::fit::device

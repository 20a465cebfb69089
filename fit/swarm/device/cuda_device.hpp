// The first CUDA device of this machine.
#pragma once

#include <memory>
#include <string>

#include "fit/swarm/device/device.hpp"

namespace booth::fit::device {

/// Whether this build can speak to CUDA devices at all.
bool cuda_built_in();
/// Null where there is none, `why` then says it in a sentence. Resets the device first when an earlier one of this process was lost.
std::unique_ptr<Device> make_cuda_device(std::string& why);

}  // namespace booth::fit::device

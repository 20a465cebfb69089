// A device that is the host: kernels run block by block, so that tests and machines without a graphics processor execute every line of them.
#pragma once

#include <memory>
#include <vector>

#include "fit/swarm/device/device.hpp"

namespace booth::fit::device {

/// What goes wrong, and when; tests change it while the device works.
struct Faults {
  DeviceError at_start = DeviceError::none;  ///< of the first allocation
  int allocations_left = -1;                 ///< then out of memory; -1: never
  int runs_left = -1;                        ///< then `error`, for ever; -1: never
  DeviceError error = DeviceError::lost;
  int starts = 0;  ///< devices made with these faults
  Order order = Order::forwards;
};

/// `faults` outlives the device.
std::unique_ptr<Device> make_emulated_device(Faults& faults, int processors = 8);

}  // namespace booth::fit::device

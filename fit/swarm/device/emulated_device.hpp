// A device that is the host: kernels run block by block, so that tests and machines without a graphics processor execute every line of them.
#pragma once

#include <atomic>
#include <memory>
#include <vector>

#include "fit/swarm/device/device.hpp"

namespace booth::fit::device {

/// What goes wrong, and when; tests change it while the device works, from any thread.
struct Faults {
  std::atomic<DeviceError> at_start{DeviceError::none};  ///< of the first allocation
  std::atomic<int> allocations_left{-1};                 ///< then out of memory; -1: never
  std::atomic<int> runs_left{-1};                        ///< then `error`, for ever; -1: never
  std::atomic<DeviceError> error{DeviceError::lost};
  std::atomic<int> starts{0};  ///< devices made with these faults
  Order order = Order::forwards;
};

/// `faults` outlives the device.
std::unique_ptr<Device> make_emulated_device(Faults& faults, int processors = 8);

}  // namespace booth::fit::device

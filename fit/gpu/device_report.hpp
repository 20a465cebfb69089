// What is told of a device that has a substitute, and how soon it is tried again.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace booth::gpu {

/// What became of the device; a copy, taken at one moment.
struct DeviceReport {
  bool wanted = false;                                  ///< a device was asked for
  bool used = false;                                    ///< it computes now
  std::string name;                                     ///< of what computes now
  std::string problem;                                  ///< why the device does not; empty when it does
  std::uint64_t losses = 0, attempts = 0, changes = 0;  ///< times it was lost; tries to start it; times that `used` changed
};

struct GuardSettings {
  std::chrono::milliseconds first_wait{2000}, longest_wait{300000};  ///< between tries; doubles from one to the other
};

}  // namespace booth::gpu

// A graphics processor as the swarm sees it: memory, and programs of kernels that are recorded once and run every frame. CUDA is one, the emulator another.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <variant>

#include "fit/swarm/device/field_kernels.hpp"
#include "fit/swarm/device/swarm_kernels.hpp"

namespace booth::fit::device {

/// Every kernel there is. A swarm small enough takes fewer particles a block, so that all processors have something to do.
using Iterate4 = Iterate<4, 4>;
using Iterate16 = Iterate<16, 8>;
using Kernel = std::variant<TakeCloud, CountPoints, StartRows, SortPoints, DescribeBricks, DescribeCells, TakeFrame, Iterate4, Iterate16>;

struct Step {
  Kernel kernel;
  int blocks = 1;
};

enum class DeviceError : std::uint8_t {
  none,
  absent,         ///< no such device, or a driver that cannot serve this build
  out_of_memory,  ///< at the start; later nothing is allocated
  lost,           ///< an error of the device or its driver: whatever it holds is void
  late,           ///< it did not finish in time
};
constexpr const char* to_string(DeviceError e) {
  switch (e) {
    case DeviceError::none:
      return "no error";
    case DeviceError::absent:
      return "no device";
    case DeviceError::out_of_memory:
      return "out of device memory";
    case DeviceError::late:
      return "the device did not answer in time";
    default:
      return "the device was lost";
  }
}

/// One thread calls at a time; another than the one that made it is fine. Nothing throws. Memory lives as long as the device.
class Device {
 public:
  virtual ~Device() = default;
  virtual const std::string& name() const = 0;
  virtual int processors() const = 0;  ///< that run blocks side by side
  /// Of the last error, in the driver's words; empty where there was none.
  virtual const std::string& problem() const = 0;

  /// Device memory, zeroed.
  virtual DeviceError allocate(std::size_t bytes, void*& out) = 0;
  /// Host memory that the device can read and write: the same bytes at two addresses.
  virtual DeviceError allocate_pinned(std::size_t bytes, void*& host, void*& device) = 0;
  /// At the start, of what never changes.
  virtual DeviceError upload(void* to, const void* from, std::size_t bytes) = 0;
  /// Steps one after the other, each when the one before has finished. At the start. `program` numbers them from 0.
  virtual DeviceError record(std::span<const Step> steps, int& program) = 0;
  /// Runs a program and waits for its end. Allocates nothing.
  virtual DeviceError run(int program) = 0;
  /// For measurements: device time of a program, or of one of its steps after those before it (all: -1), in milliseconds: the median of `repeats`.
  virtual DeviceError time(int program, int step, int repeats, double& milliseconds) = 0;
};

template <class T>
DeviceError allocate(Device& device, std::size_t count, T*& out) {
  void* raw = nullptr;
  const DeviceError e = device.allocate(count * sizeof(T), raw);
  out = static_cast<T*>(raw);
  return e;
}

}  // namespace booth::fit::device

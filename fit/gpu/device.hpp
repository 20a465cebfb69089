// A graphics processor as its users see it: memory, and programs of kernels that are recorded once and run every frame. CUDA is one, the emulator another.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <variant>

#include "fit/gpu/reset_gate.hpp"

namespace booth::gpu {

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

/// How run() waits for a program's end.
enum class Waiting : std::uint8_t {
  busily,   ///< asks without a pause: for one thread, whose answer is awaited
  napping,  ///< sleeps some 50 us between two questions: for several threads, which would take the processors from everybody else
};

/// One kernel of a program, and how many blocks of it. `Kernels::Any` is a std::variant of every kernel that a user has (gpu/launch.hpp says what a kernel is).
template <class Kernels>
struct Step {
  typename Kernels::Any kernel;
  int blocks = 1;
};

/// One thread calls at a time; another than the one that made it is fine. Nothing throws. Memory lives as long as the device.
template <class Kernels>
class Device {
 public:
  virtual ~Device() = default;
  virtual const std::string& name() const = 0;
  virtual int processors() const = 0;  ///< that run blocks side by side
  /// Of the last error, in the driver's words; empty where there was none.
  virtual const std::string& problem() const = 0;

  /// To be kept, by one who has none yet, while anything below is called or pinned memory is touched: elsewhere in the process somebody may have lost the
  /// device and be about to reset it. False: that has happened, and this device is lost.
  virtual ResetGate::Hold hold() = 0;

  /// Device memory, zeroed.
  virtual DeviceError allocate(std::size_t bytes, void*& out) = 0;
  /// Host memory that the device can read and write: the same bytes at two addresses.
  virtual DeviceError allocate_pinned(std::size_t bytes, void*& host, void*& device) = 0;
  /// At the start, of what never changes.
  virtual DeviceError upload(void* to, const void* from, std::size_t bytes) = 0;
  /// Steps one after the other, each when the one before has finished. At the start. `program` numbers them from 0.
  virtual DeviceError record(std::span<const Step<Kernels>> steps, int& program) = 0;
  /// Runs a program and waits for its end. Allocates nothing.
  virtual DeviceError run(int program) = 0;
  /// For measurements: device time of a program, or of one of its steps after those before it (all: -1), in milliseconds: the median of `repeats`.
  virtual DeviceError time(int program, int step, int repeats, double& milliseconds) = 0;
};

template <class T, class Kernels>
DeviceError allocate(Device<Kernels>& device, std::size_t count, T*& out) {
  void* raw = nullptr;
  const DeviceError e = device.allocate(count * sizeof(T), raw);
  out = static_cast<T*>(raw);
  return e;
}

/// What a user takes outside the process's ordinary memory.
struct DeviceBytes {
  std::size_t device = 0;  ///< of the graphics processor's own memory, by the sizes asked for
  std::size_t pinned = 0;  ///< of the host's, locked, for the device to read and write
};

}  // namespace booth::gpu

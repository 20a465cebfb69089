// The colour stream of an emulated sensor: a small baseline JPEG in the device's framing, faults included.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "drivers/kinect2/emulator/device_model.hpp"

namespace booth::drivers::kinect2::emulator {

/// A baseline JPEG, 4:4:4, of blocks that each have one colour. `frame` moves the pattern.
std::vector<std::byte> block_jpeg(int width, int height, unsigned frame);

/// One thread. Pictures are made at construction; sending allocates nothing.
class ColourSource {
 public:
  explicit ColourSource(DeviceModel& model);
  /// One message in pieces of `transfer_bytes`; an empty piece ends one that fills its last. `send` returns false when nobody listens any more.
  void send_message(hal::MonotonicTime at, std::size_t transfer_bytes, const std::function<bool(usb::Status, std::span<const std::byte>)>& send);

 private:
  std::size_t build(std::uint32_t timestamp);

  DeviceModel& model_;
  std::vector<std::byte> jpeg_, message_;
  std::uint32_t sequence_ = 0;
};

}  // namespace booth::drivers::kinect2::emulator

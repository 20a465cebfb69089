// From bulk transfers to JPEG pictures: one message each, framed by magics and lengths that are all checked.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "drivers/usb/usb.hpp"

namespace booth::drivers::kinect2 {

struct ColourFrame {
  std::uint32_t sequence = 0, timestamp = 0;  ///< of the device; ticks of 0.125 ms
  float exposure_ms = 0, gain = 0, gamma = 0;
  std::span<const std::byte> jpeg;  ///< baseline, 1920 x 1080, three components as far as its header says; valid during the call
};

/// Whether a JPEG's header says baseline, 1920 x 1080, three components. Only markers are read; a decoder may still refuse it.
bool is_expected_jpeg(std::span<const std::byte> jpeg);

/// One thread. Its memory (2 MiB) is taken at construction.
class ColourParser {
 public:
  explicit ColourParser(std::function<void(const ColourFrame&)> on_frame);
  /// One completed transfer; a full one has kColourTransferBytes.
  void push(usb::Status status, std::span<const std::byte> data, hal::MonotonicTime arrived);
  /// For a new stream: forgets what was begun; counters go on.
  void reset();
  std::uint64_t frames() const { return frames_; }
  /// Messages that were dropped, the first one of the stream excepted.
  std::uint64_t broken() const { return broken_; }

 private:
  void drop(std::size_t last_transfer);
  bool emit();

  std::function<void(const ColourFrame&)> on_frame_;
  std::vector<std::byte> message_;
  std::size_t filled_ = 0;
  bool discarding_ = false, begun_ = false;
  std::uint64_t frames_ = 0, broken_ = 0;
};

}  // namespace booth::drivers::kinect2

// From isochronous packets to whole frames of ten packed images; whatever is lost or forged costs the frame concerned and nothing else.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "drivers/kinect2/layout.hpp"
#include "drivers/usb/usb.hpp"

namespace booth::drivers::kinect2 {

struct RawFrame {
  std::uint32_t sequence = 0, timestamp = 0;  ///< of the device; ticks of 0.125 ms
  unsigned image_mask = 0;                    ///< bit i: image i arrived; bits 0 to 8 always
  std::span<const std::byte> images;          ///< kFrameBytes, valid during the call; what did not arrive is stale
  hal::MonotonicTime arrived{};               ///< when the last needed image was complete
};

struct Footer {
  std::uint32_t timestamp = 0, sequence = 0, index = 0, length = 0;
};
/// `bytes`: kFooterBytes or more. Nothing is checked.
Footer read_footer(std::span<const std::byte> bytes);

struct InfraredCounters {
  std::uint64_t frames = 0;             ///< handed on
  std::uint64_t incomplete_frames = 0;  ///< begun, but an image was missing when the next began
  std::uint64_t lost_frames = 0;        ///< of which not one image was seen, by their numbers
  std::uint64_t lost_images = 0, broken_packets = 0, bad_footers = 0;
};

/// push() and reset() by one thread; counters() by any. Its memory (3.3 MB) is taken at construction.
class InfraredParser {
 public:
  explicit InfraredParser(std::function<void(const RawFrame&)> on_frame);
  void push(usb::Status status, std::span<const std::byte> data, hal::MonotonicTime arrived);
  /// Forgets what was begun; counters go on.
  void reset();
  InfraredCounters counters() const;
  /// A jump of the frame number by so much (ten minutes) or backwards is a device that counts anew, not a loss.
  static constexpr std::uint32_t kCountsAnew = 18'000;

 private:
  void empty_packet();
  void end_image(hal::MonotonicTime arrived);
  void accept(const Footer& footer, hal::MonotonicTime arrived);
  void begin_frame(const Footer& footer);

  static constexpr int kEmptyBetweenImages = 4;  ///< so many empty packets in a row mean that an image is over
  std::function<void(const RawFrame&)> on_frame_;
  std::vector<std::byte> current_, images_;
  std::size_t filled_ = 0;
  bool skip_ = false;
  int empty_ = 0;
  std::optional<std::uint32_t> sequence_;
  std::uint32_t timestamp_ = 0;
  unsigned mask_ = 0;
  bool emitted_ = false;
  struct {
    std::atomic<std::uint64_t> frames{0}, incomplete_frames{0}, lost_frames{0}, lost_images{0}, broken_packets{0}, bad_footers{0};
  } count_;
};

}  // namespace booth::drivers::kinect2

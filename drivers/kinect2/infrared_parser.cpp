// The state machine over packet lengths: nothing on the wire has a checksum, so lengths, counters and packet status are all there is.
#include "drivers/kinect2/infrared_parser.hpp"

#include <cstring>

#include "drivers/kinect2/bytes.hpp"

namespace booth::drivers::kinect2 {

Footer read_footer(std::span<const std::byte> bytes) {
  return {.timestamp = read_u32(bytes, 8), .sequence = read_u32(bytes, 12), .index = read_u32(bytes, 16), .length = read_u32(bytes, 20)};
}

InfraredParser::InfraredParser(std::function<void(const RawFrame&)> on_frame)
    : on_frame_(std::move(on_frame)), current_(kSubImageBytes), images_(kFrameBytes) {}

void InfraredParser::reset() {
  filled_ = 0;
  empty_ = 0;
  skip_ = emitted_ = false;
  sequence_.reset();
  mask_ = 0;
}

InfraredCounters InfraredParser::counters() const {
  return {.frames = count_.frames,
          .incomplete_frames = count_.incomplete_frames,
          .lost_frames = count_.lost_frames,
          .lost_images = count_.lost_images,
          .broken_packets = count_.broken_packets,
          .bad_footers = count_.bad_footers};
}

void InfraredParser::push(usb::Status status, std::span<const std::byte> data, hal::MonotonicTime arrived) {
  if (status != usb::Status::completed) {
    ++count_.broken_packets;
    empty_ = 0;
    // Between two images it may have been one of the empty packets, which nobody misses; if it was an image's first, that image will be too short.
    skip_ = skip_ || filled_ > 0;
    return;
  }
  if (data.empty()) return empty_packet();
  empty_ = 0;
  if (!skip_ && filled_ + data.size() <= kSubImageBytes) {
    std::memcpy(current_.data() + filled_, data.data(), data.size());
    filled_ += data.size();
  } else {
    skip_ = true;
  }
  // A full packet is followed by more; a shorter one ends the image.
  if (data.size() < kPacketBytes) end_image(arrived);
}

void InfraredParser::empty_packet() {
  if (empty_ < kEmptyBetweenImages) ++empty_;
  if (empty_ < kEmptyBetweenImages || (filled_ == 0 && !skip_)) return;
  ++count_.lost_images;  // its last packet was lost
  filled_ = 0;
  skip_ = false;
}

void InfraredParser::end_image(hal::MonotonicTime arrived) {
  const bool whole = !skip_ && filled_ == kSubImageBytes;
  filled_ = 0;
  skip_ = false;
  if (!whole) {
    ++count_.lost_images;
    return;
  }
  const Footer footer = read_footer(std::span<const std::byte>(current_).subspan(kImageBytes));
  // The index is checked before anything is shifted or copied by it.
  if (footer.length != kImageBytes || footer.index >= static_cast<std::uint32_t>(kImages)) {
    ++count_.bad_footers;
    return;
  }
  accept(footer, arrived);
}

void InfraredParser::begin_frame(const Footer& footer) {
  if (sequence_) {
    if (!emitted_) ++count_.incomplete_frames;
    const std::uint32_t step = footer.sequence - *sequence_;
    if (step > 1 && step < kCountsAnew) count_.lost_frames += step - 1;
  }
  sequence_ = footer.sequence;
  timestamp_ = footer.timestamp;
  mask_ = 0;
  emitted_ = false;
}

void InfraredParser::accept(const Footer& footer, hal::MonotonicTime arrived) {
  const unsigned bit = 1u << footer.index;
  // An image that a whole frame has already belongs to another one: the device repeats its number.
  if (!sequence_ || footer.sequence != *sequence_ || (emitted_ && (mask_ & bit) != 0)) begin_frame(footer);
  mask_ |= bit;
  if (emitted_) return;  // image 9 after the other nine
  std::memcpy(images_.data() + footer.index * kImageBytes, current_.data(), kImageBytes);
  if ((mask_ & kNeededImages) != kNeededImages) return;
  emitted_ = true;
  ++count_.frames;
  on_frame_({.sequence = footer.sequence, .timestamp = timestamp_, .image_mask = mask_, .images = images_, .arrived = arrived});
}

}  // namespace booth::drivers::kinect2

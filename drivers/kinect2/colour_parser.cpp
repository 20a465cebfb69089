// Assembling messages, and finding the end of the JPEG inside.
#include "drivers/kinect2/colour_parser.hpp"

#include <cstring>

#include "drivers/kinect2/bytes.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {
namespace {

constexpr std::size_t kHeaderBytes = 8, kTrailerBytes = 56;
constexpr std::uint32_t kHeaderMagic = 0x4242'4242, kTrailerMagic = 0x3939'3939;

bool has_marker(std::span<const std::byte> bytes, std::size_t at, unsigned marker) {
  return std::to_integer<unsigned>(bytes[at]) == 0xFF && std::to_integer<unsigned>(bytes[at + 1]) == marker;
}
unsigned big_endian(std::span<const std::byte> bytes, std::size_t at) {
  return std::to_integer<unsigned>(bytes[at]) << 8 | std::to_integer<unsigned>(bytes[at + 1]);
}

}  // namespace

bool is_expected_jpeg(std::span<const std::byte> jpeg) {
  if (jpeg.size() < 4 || !has_marker(jpeg, 0, 0xD8)) return false;
  for (std::size_t at = 2; at + 4 <= jpeg.size();) {
    if (std::to_integer<unsigned>(jpeg[at]) != 0xFF) return false;
    if (std::to_integer<unsigned>(jpeg[at + 1]) == 0xFF) {  // a marker may be preceded by any number of these
      ++at;
      continue;
    }
    const unsigned marker = std::to_integer<unsigned>(jpeg[at + 1]);
    const std::size_t length = big_endian(jpeg, at + 2);
    if (length < 2 || at + 2 + length > jpeg.size()) return false;
    if (marker == 0xC0)  // baseline
      return length >= 8 && std::to_integer<unsigned>(jpeg[at + 4]) == 8 && big_endian(jpeg, at + 5) == 1080 && big_endian(jpeg, at + 7) == 1920 &&
             std::to_integer<unsigned>(jpeg[at + 9]) == 3;
    // Other frame headers, or a scan before any frame header.
    if ((marker > 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC) || marker == 0xDA || marker == 0xD9) return false;
    at += 2 + length;
  }
  return false;
}

ColourParser::ColourParser(std::function<void(const ColourFrame&)> on_frame) : on_frame_(std::move(on_frame)), message_(kColourMessageBytes) {}

void ColourParser::reset() {
  filled_ = 0;
  discarding_ = begun_ = false;
}

void ColourParser::drop(std::size_t last_transfer) {
  broken_ += begun_;  // a stream may begin in the middle of a message: that one is nobody's fault
  begun_ = true;
  filled_ = 0;
  // What follows belongs to the same message until a short transfer has ended it.
  discarding_ = last_transfer == kColourTransferBytes;
}

void ColourParser::push(usb::Status status, std::span<const std::byte> data, hal::MonotonicTime) {
  if (status != usb::Status::completed) {
    if (status != usb::Status::timed_out) drop(kColourTransferBytes);
    return;
  }
  if (discarding_) {
    discarding_ = data.size() == kColourTransferBytes;
    return;
  }
  if (filled_ == 0 && data.empty()) return;  // ends a message that filled its last transfer
  if (filled_ + data.size() > message_.size()) return drop(data.size());
  if (!data.empty()) std::memcpy(message_.data() + filled_, data.data(), data.size());
  filled_ += data.size();
  const auto message = std::span<const std::byte>(message_).first(filled_);
  if (filled_ >= kHeaderBytes + 2 && (read_u32(message, 4) != kHeaderMagic || !has_marker(message, kHeaderBytes, 0xD8))) return drop(data.size());
  if (emit()) {
    filled_ = 0;
  } else if (data.size() < kColourTransferBytes) {
    drop(data.size());
  }
}

bool ColourParser::emit() {
  if (filled_ <= kHeaderBytes + kTrailerBytes) return false;
  const auto message = std::span<const std::byte>(message_).first(filled_);
  const std::size_t t = filled_ - kTrailerBytes;
  if (read_u32(message, t) != kTrailerMagic || read_u32(message, t + 32) != kHeaderMagic) return false;
  const std::size_t room = filled_ - kHeaderBytes - kTrailerBytes;
  const std::uint32_t filler = read_u32(message, t + 8);
  if (read_u32(message, t + 36) != filled_ || read_u32(message, t + 4) != read_u32(message, 0) || filler > room) return false;
  const auto padded = message.subspan(kHeaderBytes, room - filler);
  for (std::size_t pad = 0; pad < 4 && pad + 4 <= padded.size(); ++pad) {
    const auto jpeg = padded.first(padded.size() - pad);
    if (has_marker(jpeg, jpeg.size() - 2, 0xD9)) {
      if (!is_expected_jpeg(jpeg)) return false;
      ++frames_;
      begun_ = true;
      on_frame_({.sequence = read_u32(message, 0),
                 .timestamp = read_u32(message, t + 20),
                 .exposure_ms = read_f32(message, t + 24),
                 .gain = read_f32(message, t + 28),
                 .gamma = read_f32(message, t + 40),
                 .jpeg = jpeg});
      return true;
    }
    if (std::to_integer<unsigned>(jpeg[jpeg.size() - 1]) != 0xA5) return false;
  }
  return false;
}

}  // namespace booth::drivers::kinect2

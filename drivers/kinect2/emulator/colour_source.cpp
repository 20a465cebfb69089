// The smallest JPEG that every decoder takes, and the message around it.
#include "drivers/kinect2/emulator/colour_source.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <initializer_list>

#include "drivers/kinect2/bytes.hpp"

namespace booth::drivers::kinect2::emulator {
namespace {

constexpr std::size_t kHeader = 8, kTrailer = 56, kFiller = 64;

void append(std::vector<std::byte>& out, std::initializer_list<int> bytes) {
  for (const int b : bytes) out.push_back(static_cast<std::byte>(b));
}

/// Entropy-coded bits; a byte FF is followed by a zero.
class Bits {
 public:
  explicit Bits(std::vector<std::byte>& out) : out_(out) {}
  void put(unsigned bits, int count) {
    for (int i = count - 1; i >= 0; --i) {
      held_ = held_ << 1 | (bits >> i & 1u);
      if (++count_ == 8) flush();
    }
  }
  void finish() {
    while (count_ > 0) put(1, 1);
  }

 private:
  void flush() {
    out_.push_back(static_cast<std::byte>(held_));
    if (held_ == 0xFF) out_.push_back(std::byte{0});
    held_ = 0;
    count_ = 0;
  }
  std::vector<std::byte>& out_;
  unsigned held_ = 0;
  int count_ = 0;
};

/// Our own Huffman tables: twelve difference categories of four bits each, and an AC table whose only symbol ends the block in one bit.
void put_block(Bits& bits, int level, int& previous) {
  const int difference = level - previous;
  previous = level;
  const auto magnitude = static_cast<unsigned>(std::abs(difference));
  const int category = std::bit_width(magnitude);
  bits.put(static_cast<unsigned>(category), 4);
  if (category > 0) bits.put(difference > 0 ? magnitude : ~magnitude & ((1u << category) - 1), category);
  bits.put(0, 1);
}

}  // namespace

std::vector<std::byte> block_jpeg(int width, int height, unsigned frame) {
  std::vector<std::byte> out;
  append(out, {0xFF, 0xD8, 0xFF, 0xDB, 0, 67, 0});
  for (int i = 0; i < 64; ++i) append(out, {8});  // a level is the block's mean above the middle
  append(out, {0xFF, 0xC0, 0, 17, 8, height >> 8, height & 255, width >> 8, width & 255, 3, 1, 0x11, 0, 2, 0x11, 0, 3, 0x11, 0});
  append(out, {0xFF, 0xC4, 0, 31, 0x00, 0, 0, 0, 12, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11});
  append(out, {0xFF, 0xC4, 0, 20, 0x10, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  append(out, {0xFF, 0xDA, 0, 12, 3, 1, 0x00, 2, 0x00, 3, 0x00, 0, 63, 0});
  Bits bits(out);
  std::array<int, 3> previous{};
  for (int y = 0; y < (height + 7) / 8; ++y)
    for (int x = 0; x < (width + 7) / 8; ++x) {
      const int bar = (x + static_cast<int>(frame)) / 30 % 4, shade = y * 120 / ((height + 7) / 8) - 60;
      put_block(bits, shade, previous[0]);
      put_block(bits, 40 * (bar & 1) - 20, previous[1]);
      put_block(bits, 40 * (bar >> 1) - 20, previous[2]);
    }
  bits.finish();
  append(out, {0xFF, 0xD9});
  return out;
}

ColourSource::ColourSource(DeviceModel& model) : model_(model), jpeg_(block_jpeg(1920, 1080, 0)), message_(kColourMessageBytes + (1u << 20)) {}

std::size_t ColourSource::build(std::uint32_t timestamp) {
  auto& faults = model_.faults();
  const std::span<std::byte> m(message_);
  std::size_t jpeg = jpeg_.size();
  std::copy(jpeg_.begin(), jpeg_.end(), m.begin() + kHeader);
  if (faults.take(Fault::colour_without_end)) write_u16(m, kHeader + jpeg - 2, 0);
  if (faults.take(Fault::colour_truncated_scan)) jpeg /= 2, m[kHeader + jpeg - 2] = std::byte{0xFF}, m[kHeader + jpeg - 1] = std::byte{0xD9};
  constexpr std::size_t kHeightInJpeg = 2 + 69 + 5;
  if (faults.take(Fault::colour_huge_picture)) write_u32(m, kHeader + kHeightInJpeg, 0xFFFF'FFFF);
  std::size_t end = kHeader + jpeg;
  while (end % 4 != 0) m[end++] = std::byte{0xA5};
  const std::size_t filler = faults.take(Fault::colour_too_long) ? kColourMessageBytes : kFiller;
  std::fill_n(m.begin() + static_cast<std::ptrdiff_t>(end), filler, std::byte{'Z'});
  end += filler;
  const std::span<std::byte> trailer = m.subspan(end, kTrailer);
  std::fill(trailer.begin(), trailer.end(), std::byte{0});
  end += kTrailer;
  write_u32(m, 0, sequence_);
  write_u32(m, 4, 0x4242'4242);
  write_u32(trailer, 0, 0x3939'3939);
  write_u32(trailer, 4, sequence_);
  write_u32(trailer, 8, static_cast<std::uint32_t>(faults.take(Fault::colour_filler_too_long) ? end : filler));
  write_u32(trailer, 20, timestamp);
  write_f32(trailer, 24, 16.0f);
  write_f32(trailer, 28, 1.0f);
  write_u32(trailer, 32, 0x4242'4242);
  write_u32(trailer, 36, static_cast<std::uint32_t>(end + faults.take(Fault::colour_wrong_size)));
  write_f32(trailer, 40, 1.0f);
  ++sequence_;
  return end;
}

void ColourSource::send_message(hal::MonotonicTime at, std::size_t transfer_bytes, const std::function<bool(usb::Status, std::span<const std::byte>)>& send) {
  const std::size_t size = build(static_cast<std::uint32_t>(at.time_since_epoch().count() / (1'000'000'000 / kTicksPerSecond)));
  const auto message = std::span<const std::byte>(message_).first(size);
  for (std::size_t from = 0; from <= size; from += transfer_bytes)  // one of whole transfers is ended by an empty one
    if (!send(usb::Status::completed, message.subspan(from, std::min(transfer_bytes, size - from)))) return;
}

}  // namespace booth::drivers::kinect2::emulator

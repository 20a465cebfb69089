// Nibbles are gathered in 64 bits, and short numbers come from a table: a loop over nibbles would take three times as long.
#include "drivers/recording/rvl.hpp"

#include <array>
#include <bit>
#include <cstring>

namespace booth::drivers {
namespace {

static_assert(std::endian::native == std::endian::little, "words are stored as they lie in memory");

/// Nibbles of a number, the first one in the highest bits, and how many bits they are.
struct Code {
  std::uint16_t nibbles;
  std::uint16_t bits;
};
constexpr std::size_t kCodes = 512;  // three nibbles: differences of less than 256 mm
constexpr std::array<Code, kCodes> make_codes() {
  std::array<Code, kCodes> codes{};
  for (std::uint32_t value = 0; value < kCodes; ++value) {
    std::uint32_t left = value;
    Code c{0, 0};
    do {
      const std::uint32_t nibble = (left & 7) | (left > 7 ? 8 : 0);
      left >>= 3;
      c = {static_cast<std::uint16_t>(c.nibbles << 4 | nibble), static_cast<std::uint16_t>(c.bits + 4)};
    } while (left != 0);
    codes[value] = c;
  }
  return codes;
}
constexpr std::array<Code, kCodes> kCode = make_codes();

class NibbleWriter {
 public:
  explicit NibbleWriter(std::byte* out) : begin_(out), out_(out) {}
  void put(std::uint32_t value) {
    if (value < kCodes) {
      append(kCode[value].nibbles, kCode[value].bits);
      return;
    }
    for (; value > 7; value >>= 3) append((value & 7) | 8, 4);
    append(value, 4);
  }
  std::size_t finish() {
    if (bits_ > 0) store(static_cast<std::uint32_t>(word_ << (32 - bits_)));
    return static_cast<std::size_t>(out_ - begin_);
  }

 private:
  void append(std::uint32_t nibbles, unsigned bits) {
    word_ = word_ << bits | nibbles;
    bits_ += bits;
    if (bits_ < 32) return;
    bits_ -= 32;
    store(static_cast<std::uint32_t>(word_ >> bits_));
  }
  void store(std::uint32_t word) {
    std::memcpy(out_, &word, sizeof word);
    out_ += sizeof word;
  }

  std::byte *begin_, *out_;
  std::uint64_t word_ = 0;
  unsigned bits_ = 0;
};

class NibbleReader {
 public:
  explicit NibbleReader(std::span<const std::byte> data) : data_(data) {}
  /// False at the end of the bytes, or for a number that has more than 32 bits.
  bool get(std::uint32_t& value) {
    value = 0;
    for (unsigned shift = 0; shift < 33; shift += 3) {
      if (bits_ == 0) {
        if (data_.size() < sizeof word_) return false;
        std::memcpy(&word_, data_.data(), sizeof word_);
        data_ = data_.subspan(sizeof word_);
        bits_ = 32;
      }
      bits_ -= 4;
      const std::uint32_t nibble = word_ >> 28;
      word_ <<= 4;
      value |= (nibble & 7) << shift;
      if (nibble < 8) return true;
    }
    return false;
  }

 private:
  std::span<const std::byte> data_;
  std::uint32_t word_ = 0;
  unsigned bits_ = 0;
};

}  // namespace

std::size_t rvl_pack(std::span<const std::uint16_t> depth, std::byte* out) noexcept {
  NibbleWriter writer(out);
  const std::uint16_t *at = depth.data(), *const end = at + depth.size();
  std::int32_t last = 0;
  while (at != end) {
    const std::uint16_t* const zeros = at;
    while (at != end && *at == 0) ++at;
    writer.put(static_cast<std::uint32_t>(at - zeros));
    const std::uint16_t* const others = at;
    const std::uint16_t* stop = at;
    while (stop != end && *stop != 0) ++stop;
    writer.put(static_cast<std::uint32_t>(stop - others));
    for (; at != stop; ++at) {
      const std::int32_t difference = static_cast<std::int32_t>(*at) - last;
      writer.put(static_cast<std::uint32_t>(difference << 1 ^ difference >> 31));
      last = *at;
    }
  }
  return writer.finish();
}

bool rvl_unpack(std::span<const std::byte> packed, std::span<std::uint16_t> depth) noexcept {
  NibbleReader reader(packed);
  std::size_t at = 0;
  std::uint32_t last = 0;
  while (at < depth.size()) {
    std::uint32_t zeros = 0, others = 0;
    if (!reader.get(zeros) || !reader.get(others) || zeros > depth.size() - at || others > depth.size() - at - zeros) return false;
    std::memset(depth.data() + at, 0, zeros * sizeof(std::uint16_t));
    at += zeros;
    for (const std::size_t stop = at + others; at < stop; ++at) {
      std::uint32_t code = 0;
      if (!reader.get(code)) return false;
      last += code >> 1 ^ (0u - (code & 1));
      depth[at] = static_cast<std::uint16_t>(last);
    }
  }
  return true;
}

}  // namespace booth::drivers

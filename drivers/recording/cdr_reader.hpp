// Reads CDR (XCDR1, either byte order) from hostile bytes without exceptions and without allocating: what the frame path needs.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>

namespace booth::drivers {

/// After the first read past the end everything reads as zero and ok() is false.
class CdrReader {
 public:
  explicit CdrReader(std::span<const std::byte> message) : data_(message) {
    // Encapsulation: 0x00 0x00 big-endian CDR, 0x00 0x01 little-endian CDR, two bytes of options.
    if (message.size() < 4 || message[0] != std::byte{0} || message[1] > std::byte{1}) {
      ok_ = false;
      return;
    }
    swap_ = (message[1] == std::byte{1}) != (std::endian::native == std::endian::little);
    data_ = message.subspan(4);
  }

  bool ok() const { return ok_; }

  template <typename T>
  T get() {
    static_assert(std::is_arithmetic_v<T>);
    const std::size_t start = (position_ + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    if (!take(start, sizeof(T))) return T{};
    std::byte bytes[sizeof(T)];
    std::memcpy(bytes, data_.data() + start, sizeof(T));
    if (swap_)
      for (std::size_t i = 0; i < sizeof(T) / 2; ++i) std::swap(bytes[i], bytes[sizeof(T) - 1 - i]);
    T value;
    std::memcpy(&value, bytes, sizeof(T));
    return value;
  }

  /// Points into the message.
  std::string_view text() {
    const auto length = get<std::uint32_t>();
    const std::size_t start = position_;
    if (length == 0 || !take(start, length)) return {};
    return {reinterpret_cast<const char*>(data_.data() + start), length - 1};  // without the terminating zero
  }

  /// A sequence of octets; points into the message.
  std::span<const std::byte> octets() {
    const auto length = get<std::uint32_t>();
    const std::size_t start = position_;
    return take(start, length) ? data_.subspan(start, length) : std::span<const std::byte>{};
  }

 private:
  bool take(std::size_t start, std::size_t size) {
    ok_ = ok_ && start <= data_.size() && size <= data_.size() - start;
    if (ok_) position_ = start + size;
    return ok_;
  }

  std::span<const std::byte> data_;
  std::size_t position_ = 0;
  bool swap_ = false, ok_ = true;
};

}  // namespace booth::drivers

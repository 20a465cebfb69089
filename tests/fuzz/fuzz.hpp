// What the fuzz targets share: taking an input apart, and saying that a promise was broken.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>

namespace booth::fuzz {

/// Numbers and bytes from the front of an input; zeros after its end.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : rest_(std::as_bytes(std::span(data, size))) {}
  bool empty() const { return rest_.empty(); }
  std::uint8_t u8() {
    if (rest_.empty()) return 0;
    const auto value = std::to_integer<std::uint8_t>(rest_[0]);
    rest_ = rest_.subspan(1);
    return value;
  }
  std::uint16_t u16() {
    const unsigned low = u8(), high = u8();
    return static_cast<std::uint16_t>(low | high << 8);
  }
  std::uint32_t u32() {
    const std::uint32_t low = u16(), high = u16();
    return low | high << 16;
  }
  /// At most `count`; fewer at the end.
  std::span<const std::byte> bytes(std::size_t count) {
    const auto out = rest_.first(count < rest_.size() ? count : rest_.size());
    rest_ = rest_.subspan(out.size());
    return out;
  }

 private:
  std::span<const std::byte> rest_;
};

/// Bytes that a target makes itself, so that an input stays small: the same for the same seed.
inline void fill(std::span<std::byte> out, std::uint32_t seed) {
  for (std::byte& b : out) {
    seed = seed * 1664525u + 1013904223u;
    b = static_cast<std::byte>(seed >> 24);
  }
}

/// Ends the program, which a fuzzer notices and a test reports.
inline void require(bool good, const char* promise) {
  if (good) return;
  std::fprintf(stderr, "broken promise: %s\n", promise);
  std::abort();
}

}  // namespace booth::fuzz

/// One input. The name and the types are libFuzzer's.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

// Counter-based random numbers: a value is a pure function of (seed, frame, particle, dimension, draw), so threads cannot change it.
#pragma once

#include <array>
#include <cstdint>

namespace booth::fit {

/// Philox4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011).
constexpr std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter, std::array<std::uint32_t, 2> key) {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t a = std::uint64_t{0xD2511F53u} * counter[0];
    const std::uint64_t b = std::uint64_t{0xCD9E8D57u} * counter[2];
    counter = {static_cast<std::uint32_t>(b >> 32) ^ counter[1] ^ key[0], static_cast<std::uint32_t>(b),
               static_cast<std::uint32_t>(a >> 32) ^ counter[3] ^ key[1], static_cast<std::uint32_t>(a)};
    key[0] += 0x9E3779B9u;
    key[1] += 0xBB67AE85u;
  }
  return counter;
}

/// The random numbers of one frame. Copyable, stateless.
class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t frame) : key_{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)}, frame_(frame) {}

  /// Four independent words for (particle, dimension, draw).
  std::array<std::uint32_t, 4> words(std::uint32_t particle, std::uint32_t dimension, std::uint32_t draw) const {
    // 64 bits of frame share the counter with 16 bits each of dimension and draw.
    return philox({static_cast<std::uint32_t>(frame_), static_cast<std::uint32_t>(frame_ >> 32), particle, (dimension << 16) | (draw & 0xFFFFu)}, key_);
  }

  /// Uniform in [0, 1).
  static constexpr float uniform(std::uint32_t word) { return static_cast<float>(word >> 8) * 0x1p-24f; }

  /// Uniform in [0, 1) in steps of 2^-16, from either half of a word.
  static constexpr float low(std::uint32_t word) { return static_cast<float>(word & 0xFFFFu) * 0x1p-16f; }
  static constexpr float high(std::uint32_t word) { return static_cast<float>(word >> 16) * 0x1p-16f; }

  /// Standard normal, cut at six sigma: the sum of twelve 10-bit uniforms less six (Irwin-Hall). Only exact operations, so the bits are the same everywhere.
  static float normal(const std::array<std::uint32_t, 4>& words) {
    // Each 32-bit word gives three 10-bit uniforms.
    int sum = 0;
    for (std::uint32_t w : words) sum += static_cast<int>((w & 1023u) + ((w >> 10) & 1023u) + ((w >> 20) & 1023u));
    return (static_cast<float>(sum) - 12 * 511.5f) * (1.0f / 1024.0f);
  }

 private:
  std::array<std::uint32_t, 2> key_;
  std::uint64_t frame_;
};

}  // namespace booth::fit

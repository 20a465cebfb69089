// One row at a time: path length, phases, measurements, codes, packing.
#include "drivers/kinect2/emulator/forward_model.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/kinect2/decoder/constants.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2::emulator {
namespace {

constexpr std::array<float, 3> kPeriod{3, 15, 2};  ///< base units
constexpr float kBaseUnit = 1250;                  ///< millimetres of light path, there and back
constexpr int kMostMagnitude = 16320;

/// The nearest code of every magnitude; exact halves go up.
std::array<std::uint16_t, kMostMagnitude + 1> make_codes() {
  std::array<std::uint16_t, kMostMagnitude + 1> codes{};
  unsigned code = 0;
  for (int m = 0; m <= kMostMagnitude; ++m) {
    while (code < 1023 && 2 * m >= value_of_code(code) + value_of_code(code + 1)) ++code;
    codes[static_cast<std::size_t>(m)] = static_cast<std::uint16_t>(code);
  }
  return codes;
}

/// SplitMix64: good enough for noise, and the same everywhere.
std::uint64_t mix(std::uint64_t x) {
  x += 0x9e37'79b9'7f4a'7c15;
  x = (x ^ (x >> 30)) * 0xbf58'476d'1ce4'e5b9;
  x = (x ^ (x >> 27)) * 0x94d0'49bb'1331'11eb;
  return x ^ (x >> 31);
}

/// Sum of eight uniform bytes: near enough to a normal distribution of standard deviation one.
float normal(std::uint64_t bits) {
  int sum = 0;
  for (int k = 0; k < 8; ++k) sum += static_cast<int>(bits >> (8 * k) & 0xFF);
  return static_cast<float>(sum - 1020) * (1.0f / 209.02f);
}

void pack(std::span<const std::uint16_t> slots, std::byte* row) {
  std::uint64_t bits = 0;
  int count = 0;
  for (const std::uint16_t code : slots) {
    bits |= static_cast<std::uint64_t>(code) << count;
    for (count += 11; count >= 8; count -= 8, bits >>= 8) *row++ = static_cast<std::byte>(bits & 0xFF);
  }
}

}  // namespace

DepthCameraParameters typical_camera() {
  return {.fx = 365.4028, .fy = 365.4028, .cx = 260.9255, .cy = 205.5946, .k1 = 0.095575, .k2 = -0.277055, .p1 = 0, .p2 = 0, .k3 = 0.097539};
}

PhaseOffsets zero_phase_offsets() {
  PhaseOffsets out;
  for (auto& table : out.p0) table.assign(kPixels, 0);
  return out;
}

PhaseOffsets realistic_phase_offsets() {
  PhaseOffsets out = zero_phase_offsets();
  constexpr std::array<double, 3> kGain{5, 1, 7.5};
  for (std::size_t f = 0; f < 3; ++f)
    for (int r = 0; r < kHeight; ++r)
      for (int c = 0; c < kWidth; ++c)
        out.p0[f][static_cast<std::size_t>(r * kWidth + c)] = static_cast<std::uint16_t>(std::lround(kGain[f] * (2284 + 1.5 * r + 0.7 * c)));
  return out;
}

ForwardModel::ForwardModel(const DepthCameraParameters& camera, const PhaseOffsets& phase) : rays_(make_ray_table(camera)) {
  for (std::size_t f = 0; f < 3; ++f) {
    offset_[f].resize(kPixels);
    for (std::size_t i = 0; i < kPixels; ++i) offset_[f][i] = static_cast<float>(phase.p0.at(f).at(i)) / 65536.0f;
  }
}

void ForwardModel::encode(std::span<const float> depth_mm, std::span<const float> infrared, double noise_counts, std::uint64_t seed,
                          std::span<std::byte> images) const {
  static const auto codes = make_codes();
  const auto noise = static_cast<float>(noise_counts);
  std::fill(images.begin(), images.end(), std::byte{0});
  std::array<std::array<std::uint16_t, kWidth>, 9> slots;
  for (int r = 0; r < kHeight; ++r) {
    for (auto& s : slots) s.fill(0);
    for (int c = 0; c < kWidth; ++c) {
      const auto i = static_cast<std::size_t>(r * kWidth + c);
      const float z = depth_mm[i];
      if (!(z > 0) || rays_.s[i] == 0) continue;
      const double zs = static_cast<double>(z) * rays_.s[i];
      const double d = zs + std::sqrt(std::max(0.0, zs * zs - kEmitter * z * rays_.xu[i]));
      const auto slot = static_cast<std::size_t>(slot_of(c));
      for (std::size_t f = 0; f < 3; ++f) {
        const double turns = d / kBaseUnit / kPeriod[f] - offset_[f][i];
        const auto phase = static_cast<float>(2 * std::numbers::pi * (turns - std::floor(turns)));
        const float amplitude = infrared[i] / static_cast<float>(16 * kFrequencyGain[f]);
        const float x = amplitude * std::cos(phase), y = amplitude * std::sin(phase);
        // cos(phi + 2 pi k / 3) for k = 0, 1, 2.
        const std::array<float, 3> m{x, -0.5f * x - 0.8660254f * y, -0.5f * x + 0.8660254f * y};
        for (std::size_t k = 0; k < 3; ++k) {
          const float value = noise > 0 ? m[k] + noise * normal(mix(seed ^ mix(9 * i + 3 * f + k))) : m[k];
          const auto magnitude = static_cast<int>(std::min(std::abs(value) + 0.5f, static_cast<float>(kMostMagnitude)));
          const std::uint16_t code = codes[static_cast<std::size_t>(magnitude)];
          slots[3 * f + k][slot] = code == 0 || value >= 0 ? code : static_cast<std::uint16_t>(1024 + code);
        }
      }
    }
    for (std::size_t k = 0; k < 9; ++k) pack(slots[k], images.data() + k * kImageBytes + static_cast<std::size_t>(raw_row(r)) * kRowBytes);
  }
}

}  // namespace booth::drivers::kinect2::emulator

// The decoder written down as the method is described, in double precision and without tricks: what the kernels are compared with.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "drivers/kinect2/decoder/constants.hpp"
#include "drivers/kinect2/decoder/kernels.hpp"
#include "drivers/kinect2/layout.hpp"
#include "drivers/kinect2/lens.hpp"

namespace booth::drivers::kinect2 {
namespace {

struct Vector {
  double a = 0, b = 0;
};
using Vectors = std::array<Vector, 3>;

unsigned code_at(std::span<const std::byte> image, int r, int c) {
  const std::size_t bit = 11 * static_cast<std::size_t>(slot_of(c));
  const std::byte* row = image.data() + static_cast<std::size_t>(raw_row(r)) * kRowBytes;
  unsigned bits = 0;
  for (std::size_t k = 0; k < 3 && bit / 8 + k < kRowBytes; ++k) bits |= std::to_integer<unsigned>(row[bit / 8 + k]) << (8 * k);
  return bits >> (bit % 8) & 0x7FF;
}

double wrapped_turn(double b, double a) {
  const double q = std::atan2(b, a) / (2 * std::numbers::pi);
  return q - std::floor(q);
}

class ReferenceDecoder final : public Decoder {
 public:
  ReferenceDecoder(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings)
      : settings_(settings),
        rays_(make_ray_table(camera)),
        phase_(phase),
        raw_(kPixels),
        filtered_(kPixels),
        ok_(kPixels),
        sum_(kPixels),
        range_(kPixels),
        depth_(kPixels),
        ir_(kPixels) {}

  Kernel kernel() const override { return Kernel::reference; }
  std::span<const float> depth_millimetres() const override { return depth_; }
  std::size_t memory_bytes() const override { return kPixels * (2 * sizeof(Vectors) + 3 * 4 + 6 + 1 + 8 + 8 + 4 + 4); }

  void decode(std::span<const std::byte> images, std::span<std::uint16_t> depth, std::span<std::uint16_t> infrared) override {
    for (int r = 0; r < kHeight; ++r)
      for (int c = 0; c < kWidth; ++c) measure(images, r, c);
    for (int r = 0; r < kHeight; ++r)
      for (int c = 0; c < kWidth; ++c) smooth(r, c);
    for (int r = 0; r < kHeight; ++r)
      for (int c = 0; c < kWidth; ++c) unwrap(r, c);
    for (int r = 0; r < kHeight; ++r)
      for (int c = 0; c < kWidth; ++c) depth_[at(r, c)] = static_cast<float>(accepted(r, c));
    for (int r = 0; r < kHeight; ++r)
      for (int c = 0; c < kWidth; ++c) {
        depth[at(r, kWidth - 1 - c)] = static_cast<std::uint16_t>(std::lround(depth_[at(r, c)]));
        if (!infrared.empty()) infrared[at(r, kWidth - 1 - c)] = static_cast<std::uint16_t>(std::lround(ir_[at(r, c)]));
      }
  }

 private:
  static std::size_t at(int r, int c) { return static_cast<std::size_t>(r * kWidth + c); }
  static bool interior(int r, int c) { return r >= 1 && r <= kHeight - 2 && c >= 1 && c <= kWidth - 2; }

  void measure(std::span<const std::byte> images, int r, int c) {
    const std::size_t i = at(r, c);
    double amplitudes = 0;
    for (std::size_t f = 0; f < 3; ++f) {
      Vector v;
      bool saturated = false;
      if (c > 0 && c < kWidth - 1) {
        const double p = -kPhasePerCount * phase_.p0[f][i];
        for (std::size_t k = 0; k < 3; ++k) {
          const int m = value_of_code(code_at(images.subspan((3 * f + k) * kImageBytes, kImageBytes), r, c));
          const double theta = p + 2 * std::numbers::pi * static_cast<double>(k) / 3;
          saturated = saturated || m == kSaturated;
          v.a += kFrequencyGain[f] * m * std::cos(theta);
          v.b -= kFrequencyGain[f] * m * std::sin(theta);
        }
      }
      raw_[i][f] = saturated ? Vector{} : v;
      amplitudes += saturated ? 65535.0 : kAmplitudeGain * std::hypot(v.a, v.b);
    }
    ir_[i] = static_cast<float>(std::min(65535.0, kInfraredGain * amplitudes / 3));
  }

  void smooth(int r, int c) {
    const std::size_t i = at(r, c);
    ok_[i] = true;
    if (!settings_.bilateral_filter || !interior(r, c)) {
      filtered_[i] = raw_[i];
      return;
    }
    for (std::size_t f = 0; f < 3; ++f) {
      const Vector centre = raw_[i][f];
      const double n2 = centre.a * centre.a + centre.b * centre.b;
      if (n2 == 0) {
        filtered_[i][f] = {};
        ok_[i] = false;
        continue;
      }
      const bool weak = n2 < kBilateralLeast2;
      const double least = weak ? 0 : kBilateralLeast2, exponent = weak ? 0 : kBilateralExponent * (settings_.parity ? std::numbers::log2e : 1);
      double weight = kGaussCentre, a = weight * centre.a, b = weight * centre.b, distance = 0;
      for (int dr = -1; dr <= 1; ++dr)
        for (int dc = -1; dc <= 1; ++dc) {
          if (dr == 0 && dc == 0) continue;
          const Vector q = raw_[at(r + dr, c + dc)][f];
          const double q2 = q.a * q.a + q.b * q.b;
          if (q2 == 0 || q2 < least) continue;
          const double d = (1 - (centre.a * q.a + centre.b * q.b) / std::sqrt(n2 * q2)) / 2;
          const double w = (dr != 0 && dc != 0 ? kGaussCorner : kGaussSide) * std::exp(-exponent * d);
          weight += w;
          a += w * q.a;
          b += w * q.b;
          distance += d;
        }
      filtered_[i][f] = {a / weight, b / weight};
      ok_[i] = ok_[i] && distance < kBilateralEdge;
    }
  }

  double residual_limit(double amplitude) const {
    const double scale = settings_.parity ? std::exp(std::numbers::ln10 / std::numbers::ln2 * kOffset) : std::pow(10, kOffset);
    return std::clamp(scale * std::pow(amplitude, kSlope), kLeastResidual, kMostResidual);
  }

  void unwrap(int r, int c) {
    const std::size_t i = at(r, c);
    std::array<double, 3> n{}, q{};
    for (std::size_t f = 0; f < 3; ++f) {
      n[f] = kAmplitudeGain * std::hypot(filtered_[i][f].a, filtered_[i][f].b);
      q[f] = wrapped_turn(filtered_[i][f].b, filtered_[i][f].a);
    }
    sum_[i] = n[0] + n[1] + n[2];
    range_[i] = 0;
    if (*std::min_element(n.begin(), n.end()) < kLeastAmplitude || sum_[i] < kLeastAmplitudeSum || rays_.s[i] == 0) return;
    const double u0 = 3 * q[0], u1 = 15 * q[1], u2 = 2 * q[2];
    double u = u0 + 3 * std::floor((u1 - u0) / 3 + 0.5), v1 = u1;
    const double e = std::fmod(std::abs(u - u2), 2.0);
    if (0.5 < e && e < 1.5) {
      u += 15;
      v1 += 15;
    }
    const double v2 = u2 + 2 * std::floor((u - u2) / 2 + 0.5);
    const std::array<double, 3> cycles{u / 3, v1 / 15, v2 / 2};
    const double mean = (cycles[0] + cycles[1] + cycles[2]) / 3;
    if (mean < 0) return;
    const double norm = std::sqrt(329.0), h0 = 10 / norm, h1 = 2 / norm, h2 = 15 / norm;
    const double x = h1 * cycles[2] - h2 * cycles[1], y = h2 * cycles[0] - h0 * cycles[2], z = h0 * cycles[1] - h1 * cycles[0];
    const double limit = residual_limit(*std::max_element(n.begin(), n.end())) / (2 * std::numbers::pi);
    if (x * x + y * y + z * z > limit * limit) return;
    const double d = 2 * mean * kMillimetresPerMean;
    const double denominator = 2 * d * rays_.s[i] - kEmitter * rays_.xu[i];
    if (denominator > 0) range_[i] = d * d / denominator;
  }

  double accepted(int r, int c) const {
    const std::size_t i = at(r, c);
    const double z = range_[i];
    if (!(z >= 1000 * settings_.minimum_depth && z <= 1000 * settings_.maximum_depth)) return 0;
    if (!settings_.edge_filter || !interior(r, c)) return ok_[i] ? z : 0;
    if (!ok_[i]) return 0;
    double sum = 0, squares = 0, low = z, high = z;
    for (int dr = -1; dr <= 1; ++dr)
      for (int dc = -1; dc <= 1; ++dc) {
        const std::size_t q = at(r + dr, c + dc);
        sum += sum_[q];
        squares += sum_[q] * sum_[q];
        if (range_[q] > 0 && ok_[q]) {
          low = std::min(low, range_[q]);
          high = std::max(high, range_[q]);
        }
      }
    const double deviation = std::sqrt(std::max(0.0, 9 * squares - sum * sum)) / 9;
    const bool edge =
        deviation >= kEdgeDeviation * std::max(sum / 9, kEdgeFloor) && z - low > kEdgeNear && high - z > kEdgeFar && std::max(z - low, high - z) > kEdgeMost;
    return edge ? 0 : z;
  }

  const DecoderSettings settings_;
  const RayTable rays_;
  const PhaseOffsets phase_;
  std::vector<Vectors> raw_, filtered_;
  std::vector<std::uint8_t> ok_;
  std::vector<double> sum_, range_;
  std::vector<float> depth_, ir_;
};

}  // namespace

std::unique_ptr<Decoder> make_reference_decoder(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings) {
  return std::make_unique<ReferenceDecoder>(camera, phase, settings);
}

}  // namespace booth::drivers::kinect2

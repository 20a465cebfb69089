// From a sensor's parameters and the settings to the decoder's tables and numbers.
#include "drivers/kinect2/decoder/tables.hpp"

#include <array>
#include <cmath>
#include <stdexcept>

#include "drivers/kinect2/decoder/constants.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {
namespace {

/// Coefficients of (weight exp(-strength v / 2))^(1/8) over v from 0 to 2, from five Chebyshev points: the kernels square three times instead of a longer
/// polynomial.
void fit_bilateral_weight(double weight, double strength, float (&out)[5]) {
  constexpr int n = 5;
  std::array<double, n> v{}, divided{}, c{};
  for (std::size_t i = 0; i < n; ++i) {
    v[i] = 1 + std::cos(std::numbers::pi * (2.0 * static_cast<double>(i) + 1) / (2 * n));
    divided[i] = std::pow(weight, 0.125) * std::exp(-strength * v[i] / 16);
  }
  for (std::size_t j = 1; j < n; ++j)
    for (std::size_t i = n - 1; i >= j; --i) divided[i] = (divided[i] - divided[i - 1]) / (v[i] - v[i - j]);
  for (std::size_t i = n; i-- > 0;) {  // c := c (v - v_i) + divided_i
    for (std::size_t k = n - 1; k > 0; --k) c[k] = c[k - 1] - v[i] * c[k];
    c[0] = divided[i] - v[i] * c[0];
  }
  for (std::size_t k = 0; k < n; ++k) out[k] = static_cast<float>(c[k]);
}

}  // namespace

DecoderTables make_decoder_tables(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings) {
  DecoderTables out;
  for (std::size_t f = 0; f < 3; ++f) {
    if (phase.p0.at(f).size() != kPixels) throw std::invalid_argument("a phase offset table has another size than the image");
    out.cosine[f].resize(kPixels), out.sine[f].resize(kPixels);
    for (std::size_t i = 0; i < kPixels; ++i) {
      const double p = -kPhasePerCount * phase.p0.at(f).at(i);
      out.cosine[f][i] = static_cast<float>(kFrequencyGain[f] * std::cos(p));
      out.sine[f][i] = static_cast<float>(kFrequencyGain[f] * std::sin(p));
    }
  }
  out.rays = make_ray_table(camera);
  DecodeNumbers& n = out.numbers;
  n.minimum = static_cast<float>(1000 * settings.minimum_depth);
  n.maximum = static_cast<float>(1000 * settings.maximum_depth);
  const double exponent = kBilateralExponent * (settings.parity ? std::numbers::log2e : 1.0);
  fit_bilateral_weight(kGaussCorner, exponent, n.corner);
  fit_bilateral_weight(kGaussSide, exponent, n.side);
  const double at_one = settings.parity ? std::exp(std::numbers::ln10 / std::numbers::ln2 * kOffset) : std::pow(10.0, kOffset);
  n.residual_scale = static_cast<float>(std::pow(at_one / (2 * std::numbers::pi), 2));
  n.bilateral = settings.bilateral_filter;
  n.edge = settings.edge_filter;
  return out;
}

}  // namespace booth::drivers::kinect2

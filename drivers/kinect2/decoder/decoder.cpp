// Tables and work space of the kernels, and the choice among them.
#include "drivers/kinect2/decoder.hpp"

#if defined(__x86_64__)
#include <cpuid.h>
#endif

#include <array>
#include <cmath>
#include <list>
#include <stdexcept>

#include "drivers/kinect2/decoder/constants.hpp"
#include "drivers/kinect2/decoder/kernels.hpp"
#include "drivers/kinect2/layout.hpp"
#include "drivers/kinect2/lens.hpp"

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

class KernelDecoder final : public Decoder {
 public:
  KernelDecoder(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings, Kernel kernel, KernelFunction* function)
      : kernel_(kernel), function_(function), rays_(make_ray_table(camera)) {
    const auto row = [&](std::ptrdiff_t rows) { return floats(static_cast<std::size_t>(rows * kRowFloats)) + kMargin; };
    for (std::size_t f = 0; f < 3; ++f) {
      float *cosine = floats(kPixels), *sine = floats(kPixels);
      for (std::size_t i = 0; i < kPixels; ++i) {
        const double p = -kPhasePerCount * phase.p0.at(f).at(i);
        cosine[i] = static_cast<float>(kFrequencyGain[f] * std::cos(p));
        sine[i] = static_cast<float>(kFrequencyGain[f] * std::sin(p));
      }
      work_.cos_p[f] = cosine;
      work_.sin_p[f] = sine;
      work_.length[f] = row(kRingRows);
      work_.unit_a[f] = row(kRingRows);
      work_.unit_b[f] = row(kRingRows);
    }
    work_.sum = row(kRingRows);
    work_.range = row(kRingRows);
    for (float*& column : work_.column) column = row(1);
    work_.infrared = row(1);
    work_.depth = floats(kPixels);
    work_.codes = codes_.data();
    work_.xu = rays_.xu.data();
    work_.s = rays_.s.data();
    work_.minimum = static_cast<float>(1000 * settings.minimum_depth);
    work_.maximum = static_cast<float>(1000 * settings.maximum_depth);
    const double exponent = kBilateralExponent * (settings.parity ? std::numbers::log2e : 1.0);
    fit_bilateral_weight(kGaussCorner, exponent, work_.corner);
    fit_bilateral_weight(kGaussSide, exponent, work_.side);
    const double at_one = settings.parity ? std::exp(std::numbers::ln10 / std::numbers::ln2 * kOffset) : std::pow(10.0, kOffset);
    work_.residual_scale = static_cast<float>(std::pow(at_one / (2 * std::numbers::pi), 2));
    work_.bilateral = settings.bilateral_filter;
    work_.edge = settings.edge_filter;
  }

  Kernel kernel() const override { return kernel_; }
  void decode(std::span<const std::byte> images, std::span<std::uint16_t> depth, std::span<std::uint16_t> infrared) override {
    if (images.size() < kFrameBytes || depth.size() < kPixels || (!infrared.empty() && infrared.size() < kPixels))
      throw std::invalid_argument("the decoder needs ten whole images and room for every pixel");
    function_(work_, reinterpret_cast<const unsigned char*>(images.data()), depth.data(), infrared.empty() ? nullptr : infrared.data());
  }
  std::span<const float> depth_millimetres() const override { return {work_.depth, kPixels}; }
  std::size_t memory_bytes() const override {
    std::size_t bytes = 3 * kPixels * sizeof(float) + codes_.size() * sizeof(std::uint16_t);
    for (const auto& p : planes_) bytes += p.size() * sizeof(float);
    return bytes;
  }

 private:
  static constexpr std::ptrdiff_t kMargin = (kRowFloats - kWidth) / 2;

  /// Zeros that live as long as the decoder.
  float* floats(std::size_t count) { return planes_.emplace_back(count, 0.0f).data(); }

  const Kernel kernel_;
  KernelFunction* const function_;
  const RayTable rays_;
  std::list<std::vector<float>> planes_;
  std::vector<std::uint16_t> codes_ = std::vector<std::uint16_t>(9 * kWidth);
  KernelWork work_{};
};

#if defined(__x86_64__)
/// Clang 14's __builtin_cpu_supports does not know this one.
bool has_f16c() {
  unsigned a = 0, b = 0, c = 0, d = 0;
  return __get_cpuid(1, &a, &b, &c, &d) != 0 && (c & bit_F16C) != 0;
}
#endif

bool has(Kernel kernel) {
  switch (kernel) {
    case Kernel::reference:
    case Kernel::baseline:
      return true;
#if defined(__x86_64__)
    case Kernel::avx2:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && has_f16c();
    case Kernel::avx512:
      return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
             __builtin_cpu_supports("avx512vl");
    case Kernel::neon:
      return false;
#else
    case Kernel::avx2:
    case Kernel::avx512:
      return false;
    case Kernel::neon:
#if defined(__aarch64__)
      return true;  // part of the architecture, so that the baseline code is it
#else
      return false;
#endif
#endif
  }
  return false;
}

KernelFunction* function_of([[maybe_unused]] Kernel kernel) {
#if defined(__x86_64__)
  if (kernel == Kernel::avx2) return decode_avx2;
  if (kernel == Kernel::avx512) return decode_avx512;
#endif
  return decode_baseline;
}

}  // namespace

std::string_view to_string(Kernel kernel) {
  static constexpr std::array<std::string_view, 5> kNames{"reference", "baseline", "avx2", "avx512", "neon"};
  return kNames.at(static_cast<std::size_t>(kernel));
}

std::vector<Kernel> available_kernels() {
  std::vector<Kernel> out;
  for (const Kernel k : {Kernel::reference, Kernel::baseline, Kernel::avx2, Kernel::avx512, Kernel::neon})
    if (has(k)) out.push_back(k);
  return out;
}

std::unique_ptr<Decoder> make_decoder(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings, Kernel kernel) {
  if (!has(kernel)) throw std::invalid_argument("this processor cannot run the decoder kernel " + std::string(to_string(kernel)));
  for (const auto& table : phase.p0)
    if (table.size() != kPixels) throw std::invalid_argument("a phase offset table has another size than the image");
  if (kernel == Kernel::reference) return make_reference_decoder(camera, phase, settings);
  return std::make_unique<KernelDecoder>(camera, phase, settings, kernel, function_of(kernel));
}

std::unique_ptr<Decoder> make_decoder(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings) {
  return make_decoder(camera, phase, settings, available_kernels().back());
}

}  // namespace booth::drivers::kinect2

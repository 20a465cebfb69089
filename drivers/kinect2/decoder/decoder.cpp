// Tables and work space of the kernels, and the choice among them.
#include "drivers/kinect2/decoder.hpp"

#include <array>
#include <cmath>
#include <stdexcept>

#include "drivers/kinect2/decoder/constants.hpp"
#include "drivers/kinect2/decoder/kernels.hpp"
#include "drivers/kinect2/layout.hpp"
#include "drivers/kinect2/lens.hpp"

namespace booth::drivers::kinect2 {
namespace {

using Plane = std::vector<float>;
constexpr std::size_t kSlack = kWidth;  // before and behind, for the neighbours of the first and the last row

class KernelDecoder final : public Decoder {
 public:
  KernelDecoder(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings, Kernel kernel, KernelFunction* function)
      : kernel_(kernel), function_(function), rays_(make_ray_table(camera)) {
    for (auto& plane : planes_) plane.assign(kPixels + 2 * kSlack, 0.0f);
    for (auto& row : rows_) row.assign(kWidth, 0.0f);
    packed_.assign(kWidth, 0);
    std::size_t next = 0;
    const auto take = [&] { return planes_[next++].data() + kSlack; };
    for (std::size_t f = 0; f < 3; ++f) {
      float *cosine = take(), *sine = take();
      for (std::size_t i = 0; i < kPixels; ++i) {
        const double p = -kPhasePerCount * phase.p0.at(f).at(i);
        cosine[i] = static_cast<float>(kFrequencyGain[f] * std::cos(p));
        sine[i] = static_cast<float>(kFrequencyGain[f] * std::sin(p));
      }
      work_.cos_p[f] = cosine;
      work_.sin_p[f] = sine;
      work_.a[f] = take();
      work_.b[f] = take();
      work_.unit_a[f] = take();
      work_.unit_b[f] = take();
    }
    work_.ok = take();
    work_.sum = take();
    work_.range = take();
    work_.depth = take();
    work_.xu = rays_.xu.data();
    work_.s = rays_.s.data();
    work_.packed = packed_.data();
    for (std::size_t i = 0; i < 9; ++i) work_.value[i] = rows_[i].data();
    work_.infrared = rows_[9].data();
    work_.minimum = static_cast<float>(1000 * settings.minimum_depth);
    work_.maximum = static_cast<float>(1000 * settings.maximum_depth);
    work_.exponent = static_cast<float>(kBilateralExponent * (settings.parity ? std::numbers::log2e : 1.0));
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
    return planes_.size() * planes_[0].size() * sizeof(float) + rows_.size() * kWidth * sizeof(float) + 3 * kPixels * sizeof(float) +
           kWidth * sizeof(std::uint16_t);
  }

 private:
  const Kernel kernel_;
  KernelFunction* const function_;
  const RayTable rays_;
  std::array<Plane, 22> planes_;
  std::array<Plane, 10> rows_;
  std::vector<std::uint16_t> packed_;
  KernelWork work_{};
};

bool has(Kernel kernel) {
  switch (kernel) {
    case Kernel::reference:
    case Kernel::baseline:
      return true;
#if defined(__x86_64__)
    case Kernel::avx2:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
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

KernelFunction* function_of(Kernel kernel) {
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

// Tables and work space of the kernels, and the choice among them.
#include "drivers/kinect2/decoder.hpp"

#if defined(__x86_64__)
#include <cpuid.h>
#endif

#include <array>
#include <list>
#include <stdexcept>

#include "drivers/kinect2/decoder/kernels.hpp"
#include "drivers/kinect2/decoder/tables.hpp"
#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {
namespace {

class KernelDecoder final : public Decoder {
 public:
  KernelDecoder(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings, Kernel kernel, KernelFunction* function)
      : kernel_(kernel), function_(function), tables_(make_decoder_tables(camera, phase, settings)) {
    const auto row = [&](std::ptrdiff_t rows) { return floats(static_cast<std::size_t>(rows * kRowFloats)) + kMargin; };
    for (std::size_t f = 0; f < 3; ++f) {
      work_.cos_p[f] = tables_.cosine[f].data();
      work_.sin_p[f] = tables_.sine[f].data();
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
    work_.xu = tables_.rays.xu.data();
    work_.s = tables_.rays.s.data();
    work_.numbers = tables_.numbers;
  }

  Kernel kernel() const override { return kernel_; }
  void decode(std::span<const std::byte> images, std::span<std::uint16_t> depth, std::span<std::uint16_t> infrared) override {
    check_decoder_sizes(images, depth, infrared);
    function_(work_, reinterpret_cast<const unsigned char*>(images.data()), depth.data(), infrared.empty() ? nullptr : infrared.data());
  }
  std::span<const float> depth_millimetres() const override { return {work_.depth, kPixels}; }
  std::size_t memory_bytes() const override {
    std::size_t bytes = tables_.bytes() + codes_.size() * sizeof(std::uint16_t);
    for (const auto& p : planes_) bytes += p.size() * sizeof(float);
    return bytes;
  }

 private:
  static constexpr std::ptrdiff_t kMargin = (kRowFloats - kWidth) / 2;

  /// Zeros that live as long as the decoder.
  float* floats(std::size_t count) { return planes_.emplace_back(count, 0.0f).data(); }

  const Kernel kernel_;
  KernelFunction* const function_;
  const DecoderTables tables_;
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

void check_decoder_sizes(std::span<const std::byte> images, std::span<const std::uint16_t> depth, std::span<const std::uint16_t> infrared) {
  if (images.size() < kFrameBytes || depth.size() < kPixels || (!infrared.empty() && infrared.size() < kPixels))
    throw std::invalid_argument("the decoder needs ten whole images and room for every pixel");
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

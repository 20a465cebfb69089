// From ten packed phase images to depth and infrared: a scalar reference, and kernels for the processors there are.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "drivers/kinect2/calibration.hpp"
#include "fit/gpu/device_report.hpp"

namespace booth::drivers::kinect2 {

enum class Kernel : std::uint8_t { reference, baseline, avx2, avx512, neon };
std::string_view to_string(Kernel kernel);
/// What this processor can run, slowest first; `reference` is always among them.
std::vector<Kernel> available_kernels();

struct DecoderSettings {
  bool bilateral_filter = true, edge_filter = true;
  double minimum_depth = 0.5, maximum_depth = 4.5;  ///< metres
  /// As most public decoders: natural exponentials where base 2 and 10 were surely meant. Off: as meant; rejects more doubtful pixels on bright surfaces.
  bool parity = false;
};

/// Holds tables and work space (all allocated at construction); decode() allocates nothing. One thread at a time; several decoders may run side by side.
class Decoder {
 public:
  virtual ~Decoder() = default;
  virtual Kernel kernel() const = 0;
  /// `images`: kFrameBytes, the ten packed images one after the other. `depth`: kPixels, millimetres along z, 0 = none. `infrared`: kPixels or empty.
  /// Both row-major and not mirrored (column 511 - c of the device).
  virtual void decode(std::span<const std::byte> images, std::span<std::uint16_t> depth, std::span<std::uint16_t> infrared) = 0;
  /// The last frame's depth before rounding, millimetres, device columns; for tests.
  virtual std::span<const float> depth_millimetres() const = 0;
  virtual std::size_t memory_bytes() const = 0;
  /// Of the graphics processor that decodes; `wanted` is false where there is none to speak of. From any thread.
  virtual gpu::DeviceReport report() const { return {}; }
};
/// Throws std::invalid_argument unless they are what decode() wants.
void check_decoder_sizes(std::span<const std::byte> images, std::span<const std::uint16_t> depth, std::span<const std::uint16_t> infrared);

/// Throws std::invalid_argument when this processor has no such kernel.
std::unique_ptr<Decoder> make_decoder(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings, Kernel kernel);
/// The fastest kernel there is.
std::unique_ptr<Decoder> make_decoder(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings = {});

}  // namespace booth::drivers::kinect2

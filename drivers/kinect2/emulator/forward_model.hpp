// The inverse of the decoder: from depth and brightness to the ten packed phase images a sensor would send.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/kinect2/calibration.hpp"
#include "drivers/kinect2/lens.hpp"

namespace booth::drivers::kinect2::emulator {

/// A lens as real sensors have it.
DepthCameraParameters typical_camera();
PhaseOffsets zero_phase_offsets();
/// Different in every pixel and frequency, so that an error of orientation or scale shows.
PhaseOffsets realistic_phase_offsets();

/// Const calls may run side by side.
class ForwardModel {
 public:
  ForwardModel(const DepthCameraParameters& camera, const PhaseOffsets& phase);
  /// `depth_mm` (0 = nothing there) and `infrared` (0..65535): kPixels in device columns, row 0 on top. `noise_counts`: standard deviation added to each of the
  /// nine measurements; the same seed gives the same bits. `images`: kFrameBytes.
  void encode(std::span<const float> depth_mm, std::span<const float> infrared, double noise_counts, std::uint64_t seed, std::span<std::byte> images) const;

 private:
  RayTable rays_;
  std::array<std::vector<float>, 3> offset_;  ///< turns
};

}  // namespace booth::drivers::kinect2::emulator

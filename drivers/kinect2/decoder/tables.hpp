// What a decoder works out once for its sensor and its settings: tables for each pixel, and the numbers of its formulas.
#pragma once

#include <vector>

#include "drivers/kinect2/calibration.hpp"
#include "drivers/kinect2/decoder.hpp"
#include "drivers/kinect2/decoder/phase_maths.hpp"
#include "drivers/kinect2/lens.hpp"

namespace booth::drivers::kinect2 {

/// kPixels of each, row-major, device columns.
struct DecoderTables {
  std::vector<float> cosine[3], sine[3];  ///< of the phase offsets, the frequency's gain included
  RayTable rays;
  DecodeNumbers numbers;
  std::size_t bytes() const { return sizeof(float) * (3 * (cosine[0].size() + sine[0].size()) + rays.xu.size() + rays.yu.size() + rays.s.size()); }
};

/// Throws std::invalid_argument when a phase offset table has another size than the image.
DecoderTables make_decoder_tables(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings);

}  // namespace booth::drivers::kinect2

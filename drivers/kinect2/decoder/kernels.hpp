// What the decoders behind make_decoder() share; each kernel is one function over raw arrays, compiled once for each kind of processor.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "drivers/kinect2/decoder.hpp"
#include "drivers/kinect2/decoder/phase_maths.hpp"

namespace booth::drivers::kinect2 {

std::unique_ptr<Decoder> make_reference_decoder(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings);

/// Floats of a row of work space: 512 and room for a vector's neighbours on either side.
inline constexpr std::ptrdiff_t kRowFloats = 512 + 2 * 16;
/// Rows that are alive at once, for a filter of three.
inline constexpr std::ptrdiff_t kRingRows = 3;

/// Plain pointers only: a function template of the standard library that were compiled for one processor could be linked into the code for another.
struct KernelWork {
  // Tables, kPixels each.
  const float *cos_p[3], *sin_p[3];  ///< of the phase offsets, the frequency's gain included
  const float *xu, *s;               ///< s = 0: no depth there
  // Work space, zeroed once; all of it but `depth` stays in the nearest caches.
  float *length[3], *unit_a[3], *unit_b[3];  ///< kRingRows rows each: the phase vector's length and direction; length 0: no signal
  float *sum, *range;                        ///< kRingRows rows each: amplitudes; millimetres along z, 0 where there is nothing or neighbours disagree
  float* column[4];                          ///< one row each: over three rows sum, sum of squares, nearest, farthest
  std::uint16_t* codes;                      ///< nine rows
  float* infrared;                           ///< one row
  float* depth;                              ///< kPixels
  DecodeNumbers numbers;
};

using KernelFunction = void(const KernelWork& work, const unsigned char* images, std::uint16_t* depth, std::uint16_t* infrared);
KernelFunction decode_baseline, decode_avx2, decode_avx512;

}  // namespace booth::drivers::kinect2

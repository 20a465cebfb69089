// What the decoders behind make_decoder() share; each kernel is one function over raw arrays, compiled once for each kind of processor.
#pragma once

#include <cstdint>
#include <memory>

#include "drivers/kinect2/decoder.hpp"

namespace booth::drivers::kinect2 {

std::unique_ptr<Decoder> make_reference_decoder(const DepthCameraParameters& camera, const PhaseOffsets& phase, const DecoderSettings& settings);

/// Plain pointers only: a function template of the standard library that were compiled for one processor could be linked into the code for another.
struct KernelWork {
  // Tables, kPixels each.
  const float *cos_p[3], *sin_p[3];  ///< of the phase offsets, the frequency's gain included
  const float *xu, *s;               ///< s = 0: no depth there
  // Planes, kPixels each, with a row of slack before and after.
  float *a[3], *b[3];            ///< phase vectors as measured
  float *unit_a[3], *unit_b[3];  ///< of length one; zero where there is no signal
  float *ok, *sum, *range, *depth;
  // One row each.
  std::uint16_t* packed;
  float* value[9];
  float* infrared;
  // Settings.
  float minimum, maximum;  ///< millimetres
  float exponent;          ///< of the bilateral weight
  float residual_scale;    ///< square of the residual limit at amplitude one, in turns
  bool bilateral, edge;
};

using KernelFunction = void(const KernelWork& work, const unsigned char* images, std::uint16_t* depth, std::uint16_t* infrared);
KernelFunction decode_baseline, decode_avx2, decode_avx512;

}  // namespace booth::drivers::kinect2

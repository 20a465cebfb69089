// The numbers of the phase-to-depth computation (docs/reference/kinect2.md), shared by the reference and the kernels.
#pragma once

#include <array>
#include <cmath>
#include <numbers>

#include "fit/gpu/host_device.hpp"

namespace booth::drivers::kinect2 {

inline constexpr double kPhasePerCount = 2 * std::numbers::pi / 65536;  ///< of the offset tables
inline constexpr std::array<double, 3> kFrequencyGain{1.322581, 1.0, 1.612903};
inline constexpr double kAmplitudeGain = 0.6666667, kInfraredGain = 16.0;
inline constexpr double kLeastAmplitude = 3.0, kLeastAmplitudeSum = 10.0;
inline constexpr double kGaussCorner = 0.1069973, kGaussSide = 0.1131098, kGaussCentre = 0.1195716;
inline constexpr double kBilateralLeast2 = 20.25, kBilateralExponent = 5.0, kBilateralEdge = 2.5;
inline constexpr double kSlope = -0.5330578, kOffset = 0.7694894, kLeastResidual = 0.3490659, kMostResidual = 0.6108653;
inline constexpr double kMillimetresPerMean = 2083.3333, kEmitter = 90.0;  ///< emitter: twice its 45 mm baseline
inline constexpr double kEdgeFloor = 50, kEdgeDeviation = 0.05, kEdgeNear = 50, kEdgeFar = 30, kEdgeMost = 100;
inline constexpr int kSaturated = 32767;

/// The 11-bit code: sign and magnitude, eight segments of growing steps.
constexpr int value_of_code(unsigned code) {
  if (code == 1024) return kSaturated;
  const int i = static_cast<int>(code & 1023);
  int magnitude = i;
  if (i >= 256) {
    const int segment = i / 128;  // 2..7
    magnitude = (128 << (segment - 1)) + ((i & 127) << (segment - 1));
  }
  return code > 1024 ? -magnitude : magnitude;
}

/// The packed row that holds an output row, and the slot in it that holds a column.
BOOTH_HOST_DEVICE constexpr int raw_row(int row) { return row < 212 ? row : 635 - row; }
BOOTH_HOST_DEVICE constexpr int slot_of(int column) { return (column >> 2) + 128 * (column & 3); }

}  // namespace booth::drivers::kinect2

// What the decoder is measured on: packed frames of a person in a room, and frames that leave it nothing to skip.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "drivers/kinect2/calibration.hpp"

namespace booth::bench {

using PackedFrame = std::vector<std::byte>;  ///< kFrameBytes

/// Nine phase measurements with noise of five counts, as an emulated sensor of the default booth would send them: a person in motion before floor and walls,
/// some of them beyond the range, brightness falling with the square of the distance. `count` instants of the motion, a quarter of a second apart.
std::vector<PackedFrame> person_frames(const drivers::kinect2::PhaseOffsets& phase, int count);

/// Every pixel strong and within the range, so that no early rejection helps; a slanted plane with the same noise.
std::vector<PackedFrame> worst_frames(const drivers::kinect2::PhaseOffsets& phase, int count);

}  // namespace booth::bench

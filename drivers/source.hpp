// What every driver hands to the daemon: cameras, the truth where it is known, and pictures of the empty booth where they exist.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "hal/depth_camera.hpp"
#include "hal/flight_recorder.hpp"
#include "hal/ground_truth.hpp"

namespace booth::drivers {

enum class Pace : std::uint8_t {
  own,   ///< frames arrive when they were (or would have been) taken; a reader that is late loses frames, as with a device
  fast,  ///< as fast as they are read, none lost; no camera runs more than two frames ahead of another that is streaming.
         ///< Time stamps are as if real and start at Timeline::kFastOrigin, so that every run sees the same ones.
};

/// What the live booth did with the frames of a recording, where the recording says it.
struct LiveGroups {
  std::vector<hal::FittedGroup> groups{};  ///< in the order in which they were fitted
  hal::Nanoseconds to_live{};              ///< added to a frame's `captured` at Pace::fast gives what it was live
};

struct Source {
  hal::DepthCameras cameras;
  std::shared_ptr<const hal::GroundTruth> truth;  ///< null where nothing is known
  std::vector<hal::DepthFrame> background;        ///< frames of the empty booth, of any camera, any number each
  LiveGroups live{};
};

}  // namespace booth::drivers

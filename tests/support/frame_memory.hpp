// Depth frames of a simulated booth, rendered beforehand, so that measurements and long tests do not pay for the rendering.
#pragma once

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "hal/depth_frame.hpp"
#include "hal/ground_truth.hpp"

namespace booth::tests {

struct SceneRequest {
  int body = 7;                                             ///< of the set-aside bodies, 1 to 90
  std::string motion = "showcase";                          ///< a motion's name (drivers/synthetic/motions.hpp), or a file that ends in .npy, .amc or .bvh
  double from = 0;                                          ///< seconds of a motion file that are left out at its start
  double seconds = 4;                                       ///< 0: once through the motion, so that playing it again goes on where a motion by name ended
  double leaves = std::numeric_limits<double>::infinity();  ///< from then on the stage is empty
  int divisor = 1;                                          ///< of the cameras' resolution: 2 makes a quarter of the pixels
  std::uint64_t seed = 1;
};

/// Kinect v2 noise, free-running phases and jitter, as the daemon's simulated cameras have them.
struct FrameMemory {
  std::vector<hal::CameraDescription> cameras;
  std::vector<std::vector<hal::DepthFrame>> frames;  ///< [camera][number]; `captured` counts from `origin`
  std::vector<hal::DepthFrame> background;
  std::shared_ptr<const hal::GroundTruth> truth;
  hal::MonotonicTime origin{};
  hal::Nanoseconds length{};  ///< a whole number of periods: playing it again continues the time stamps

  std::size_t bytes() const;
};

/// Throws as the loaders of models and motions do.
FrameMemory render_frames(const SceneRequest& request);

}  // namespace booth::tests

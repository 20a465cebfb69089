// Where each pixel looks: the inverse of the lens model, shared by the decoder and the emulator's forward model.
#pragma once

#include <vector>

#include "drivers/kinect2/calibration.hpp"

namespace booth::drivers::kinect2 {

/// Row-major kPixels each, device columns. Pixels for which Newton's iteration does not converge have s = 0 and decode to nothing.
struct RayTable {
  std::vector<float> xu, yu;  ///< undistorted, normalised
  std::vector<float> s;       ///< sqrt(1 + xu^2 + yu^2)
};
RayTable make_ray_table(const DepthCameraParameters& parameters);

}  // namespace booth::drivers::kinect2

// The floor as the frame itself shows it: calibration says y = 0, and a millimetre of error there is a millimetre of foot.
#pragma once

#include <Eigen/Core>
#include <span>

namespace booth::fit {

/// How far from the calibrated floor (y = 0) the real one is looked for, m.
inline constexpr float kFloorSearch = 0.10f;

/// y = height + slope_x x + slope_z z, x and z measured from the stage's centre.
struct FloorPlane {
  float height = 0, slope_x = 0, slope_z = 0;
  float sigma = 0;        ///< spread of the points about the plane, m; 0 when not measured
  bool measured = false;  ///< false: the calibrated floor

  float above(float x, float y, float z) const { return y - (height + slope_x * x + slope_z * z); }
};

/// Robust fit to points near the floor (relative to the stage's centre); feet and things that stand on the floor may be among them. With too few
/// points, or a plane further than 8 cm or 2 degrees from y = 0, the calibrated floor is returned. Fixed order, no allocation.
FloorPlane fit_floor(std::span<const Eigen::Vector3f> points);

}  // namespace booth::fit

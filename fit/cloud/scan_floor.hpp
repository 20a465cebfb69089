// Scanners see the floor that a person stands on: finds it in a cloud that no image orders, and takes it out.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace booth::fit {

struct ScanFloor {
  bool found = false;
  float height = 0;                 ///< m (y) below the middle of the cloud
  float tilt_x = 0, tilt_z = 0;     ///< slope along x and z
  float sigma = 0;                  ///< spread of its points, m
  std::vector<std::uint8_t> above;  ///< per point: 0 for the floor and what is under it; empty where there is no floor
};

/// `points` in the CMU frame (y up), metres; points that are not finite are not floor. A floor is a nearly level plane under everything else that reaches
/// beyond what stands on it: at least a fifth of a square metre of it has nothing above. The soles of feet, or the back of somebody who lies, have. Allocates;
/// deterministic.
ScanFloor find_scan_floor(const Eigen::Matrix3Xf& points);

}  // namespace booth::fit

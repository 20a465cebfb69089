// Where a point of the world falls in a camera's image.
#pragma once

#include "fit/cloud/observation.hpp"

namespace booth::fit {

struct Pixel {
  float u, v;  ///< (0, 0) is the centre of the first pixel
  float z;     ///< metres along the optical axis; <= 0: behind the camera, or where the lens model folds over; u and v are meaningless
};

/// Pinhole and Brown-Conrady distortion. CMU frame in, pixels out.
inline Pixel project(const Camera& camera, const Eigen::Vector3f& point) {
  const Eigen::Vector3f p = camera.rotation * point + camera.translation;
  if (p.z() <= 1e-3f) return {0, 0, 0};
  const float x = p.x() / p.z(), y = p.y() / p.z();
  const auto& [k1, k2, p1, p2, k3] = camera.distortion;
  const float r2 = x * x + y * y;
  // Where the distorted radius falls again the polynomial says nothing of the lens.
  if (1 + r2 * (3 * k1 + r2 * (5 * k2 + r2 * 7 * k3)) <= 0) return {0, 0, 0};
  const float radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const float xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
  const float yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
  return {camera.fx * xd + camera.cx, camera.fy * yd + camera.cy, p.z()};
}

}  // namespace booth::fit

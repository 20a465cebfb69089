// Projection through a pinhole with Brown-Conrady distortion, and back.
#pragma once

#include <Eigen/Core>

#include "hal/depth_frame.hpp"

namespace booth::drivers {

/// A point on the plane z = 1 as the lens bends it.
template <typename Real>
Eigen::Matrix<Real, 2, 1> distort(const hal::Intrinsics& k, Real x, Real y) {
  const auto d = [&](int i) { return static_cast<Real>(k.distortion[static_cast<std::size_t>(i)]); };
  const Real r2 = x * x + y * y;
  const Real radial = 1 + r2 * (d(0) + r2 * (d(1) + r2 * d(4)));
  return {x * radial + 2 * d(2) * x * y + d(3) * (r2 + 2 * x * x), y * radial + d(2) * (r2 + 2 * y * y) + 2 * d(3) * x * y};
}

/// The ray of pixel (u, v): the point on z = 1 that distort() maps there, by fixed-point iteration (1e-9).
inline Eigen::Vector2d undistorted_ray(const hal::Intrinsics& k, double u, double v) {
  const Eigen::Vector2d target((u - k.cx) / k.fx, (v - k.cy) / k.fy);
  Eigen::Vector2d ray = target;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector2d error = target - distort(k, ray.x(), ray.y());
    ray += error;
    if (error.squaredNorm() < 1e-18) break;
  }
  return ray;
}

}  // namespace booth::drivers

// Pinhole with Brown-Conrady distortion, with derivatives: the camera model of docs/reference/kinect2.md, pixel (0, 0) the centre of the first pixel.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <array>

namespace booth::fit::calibrate {

struct Lens {
  int width = 0, height = 0;              ///< pixels
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixels
  std::array<double, 5> distortion{};     ///< k1 k2 p1 p2 k3

  /// A point on the plane z = 1 as the lens bends it; `jacobian` (may be null) gets the derivative.
  Eigen::Vector2d bend(const Eigen::Vector2d& p, Eigen::Matrix2d* jacobian = nullptr) const {
    const auto& [k1, k2, p1, p2, k3] = distortion;
    const double x = p.x(), y = p.y(), r2 = x * x + y * y;
    const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
    if (jacobian != nullptr) {
      const double slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3));
      *jacobian << radial + x * x * slope + 2 * p1 * y + 6 * p2 * x, x * y * slope + 2 * p1 * x + 2 * p2 * y,  //
          x * y * slope + 2 * p1 * x + 2 * p2 * y, radial + y * y * slope + 6 * p1 * y + 2 * p2 * x;
    }
    return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
  }

  /// Pixel of a point of the camera's frame (z > 0); `jacobian` (may be null) gets the derivative by the point.
  Eigen::Vector2d project(const Eigen::Vector3d& p, Eigen::Matrix<double, 2, 3>* jacobian = nullptr) const {
    const double iz = 1 / p.z();
    const Eigen::Vector2d flat(p.x() * iz, p.y() * iz);
    Eigen::Matrix2d bent;
    const Eigen::Vector2d d = bend(flat, jacobian != nullptr ? &bent : nullptr);
    if (jacobian != nullptr) {
      Eigen::Matrix<double, 2, 3> by_point;
      by_point << iz, 0, -flat.x() * iz, 0, iz, -flat.y() * iz;
      *jacobian = Eigen::Vector2d(fx, fy).asDiagonal() * bent * by_point;
    }
    return {fx * d.x() + cx, fy * d.y() + cy};
  }

  /// The point on z = 1 that a pixel sees (Newton). Far outside a lens's field the model folds over: then the point it stopped at.
  Eigen::Vector2d ray(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector2d target((pixel.x() - cx) / fx, (pixel.y() - cy) / fy);
    Eigen::Vector2d p = target;
    for (int i = 0; i < 20; ++i) {
      Eigen::Matrix2d slope;
      const Eigen::Vector2d error = bend(p, &slope) - target;
      if (error.squaredNorm() < 1e-24) break;
      p -= std::abs(slope.determinant()) > 1e-6 ? Eigen::Vector2d(slope.inverse() * error) : error;
    }
    return p;
  }
};

}  // namespace booth::fit::calibrate

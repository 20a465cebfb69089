// Inverts the lens distortion once for each pixel and cuts each pixel's ray with the stage, so that a frame's walls fall to one comparison.
#include "fit/cloud/pixel_rays.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "fit/cloud/floor_plane.hpp"

namespace booth::fit {
namespace {

struct Ray {
  double x, y;
};

Ray distort(const std::array<float, 5>& c, double x, double y) {
  const double k1 = c[0], k2 = c[1], p1 = c[2], p2 = c[3], k3 = c[4];
  const double r2 = x * x + y * y, radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
}

/// Newton with a numeric derivative. False where the model folds over, as polynomials do beyond the corners they were fitted to.
bool undistort(const std::array<float, 5>& coefficients, double xd, double yd, double tolerance, Ray& ray) {
  double x = xd, y = yd;
  for (int i = 0; i < 30; ++i) {
    const Ray f = distort(coefficients, x, y);
    const double ex = f.x - xd, ey = f.y - yd;
    if (std::abs(ex) < 1e-9 && std::abs(ey) < 1e-9) break;
    constexpr double h = 1e-5;
    const Ray fx = distort(coefficients, x + h, y), fy = distort(coefficients, x, y + h);
    const double a = (fx.x - f.x) / h, b = (fy.x - f.x) / h, c = (fx.y - f.y) / h, d = (fy.y - f.y) / h;
    const double det = a * d - b * c;
    if (!(det > 1e-3)) return false;
    x -= (d * ex - b * ey) / det;
    y -= (a * ey - c * ex) / det;
  }
  const Ray f = distort(coefficients, x, y);
  ray = {x, y};
  return std::abs(f.x - xd) < tolerance && std::abs(f.y - yd) < tolerance;
}

/// Cuts [t0, t1] with where the ray's height c + t v lies between low and high.
void cut_slab(double c, double v, double low, double high, double& t0, double& t1) {
  if (v == 0) {
    if (c < low || c > high) t1 = -1;
    return;
  }
  const double a = (low - c) / v, b = (high - c) / v;
  t0 = std::max(t0, std::min(a, b));
  t1 = std::min(t1, std::max(a, b));
}

void cut_cylinder(double cx, double cz, double vx, double vz, double radius, double& t0, double& t1) {
  const double a = vx * vx + vz * vz, b = cx * vx + cz * vz, c = cx * cx + cz * cz - radius * radius;
  if (a < 1e-12) {
    if (c > 0) t1 = -1;
    return;
  }
  const double discriminant = b * b - a * c;
  if (discriminant <= 0) {
    t1 = -1;
    return;
  }
  const double root = std::sqrt(discriminant);
  t0 = std::max(t0, (-b - root) / a);
  t1 = std::min(t1, (-b + root) / a);
}

void check(const Camera& c) {
  const auto fail = [](const std::string& what) { throw std::invalid_argument(what + "; correct the calibration"); };
  if (c.width < 8 || c.height < 8 || c.width > kMaxImageWidth || c.height > kMaxImageWidth)
    fail("image of " + std::to_string(c.width) + " x " + std::to_string(c.height) + " pixels, 8 to 4096 are possible");
  if (!(c.fx > 1 && c.fy > 1 && c.fx < 1e5f && c.fy < 1e5f)) fail("focal length " + std::to_string(c.fx) + ", " + std::to_string(c.fy) + " px");
  if (!(std::abs(c.cx) < 1e5f && std::abs(c.cy) < 1e5f)) fail("principal point " + std::to_string(c.cx) + ", " + std::to_string(c.cy) + " px");
  if (!(c.depth_scale > 1e-6f && c.depth_scale < 1)) fail("depth scale of " + std::to_string(c.depth_scale) + " m a count");
  if (!(std::abs(c.depth_offset) < 1)) fail("depth offset of " + std::to_string(c.depth_offset) + " m");
  for (const float k : c.distortion)
    if (!std::isfinite(k)) fail("a distortion coefficient that is not a number");
  if (!c.translation.allFinite()) fail("a position that is not a number");
  if (!c.rotation.allFinite() || (c.rotation * c.rotation.transpose() - Eigen::Matrix3f::Identity()).cwiseAbs().maxCoeff() > 1e-3f ||
      c.rotation.determinant() < 0)
    fail("an orientation that is no rotation");
}

std::uint16_t clamp_count(double count) { return static_cast<std::uint16_t>(std::clamp(count, 0.0, 65535.0)); }

}  // namespace

PixelRays::PixelRays(const Camera& camera, const CloudSettings& settings)
    : width(camera.width),
      height(camera.height),
      scale(camera.depth_scale),
      offset(camera.depth_offset),
      to_world(camera.rotation.transpose()),
      centre(camera.centre()),
      background_margin_(settings.background_margin),
      background_relative_(settings.background_relative) {
  check(camera);
  min_count = std::max<std::uint16_t>(1, clamp_count(std::ceil((settings.min_depth - offset) / scale)));
  max_count = clamp_count(std::floor((settings.max_depth - offset) / scale));
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  x.resize(pixels), y.resize(pixels), near.resize(pixels), far.resize(pixels), stage_far.resize(pixels);

  const Eigen::Matrix3d rotation = to_world.cast<double>();
  const Eigen::Vector3d from(centre.x() - settings.stage_x, centre.y(), centre.z() - settings.stage_z);
  std::size_t i = 0;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u, ++i) {
      near[i] = std::numeric_limits<std::uint16_t>::max();
      stage_far[i] = 0;
      Ray ray{0, 0};
      const double xd = (u - static_cast<double>(camera.cx)) / camera.fx, yd = (v - static_cast<double>(camera.cy)) / camera.fy;
      if (undistort(camera.distortion, xd, yd, 0.2 / camera.fx, ray)) {
        const Eigen::Vector3d direction = rotation * Eigen::Vector3d(ray.x, ray.y, 1);
        double t0 = settings.min_depth, t1 = settings.max_depth;
        cut_cylinder(from.x(), from.z(), direction.x(), direction.z(), settings.stage_radius, t0, t1);
        // The floor is told from the feet by a plane that each frame corrects; the gate lets what may be either pass.
        cut_slab(from.y(), direction.y(), -kFloorSearch, settings.stage_height, t0, t1);
        if (t0 <= t1) {
          near[i] = std::max(min_count, clamp_count(std::ceil((t0 - offset) / scale)));
          stage_far[i] = std::min(max_count, clamp_count(std::floor((t1 - offset) / scale)));
        }
      }
      x[i] = static_cast<float>(ray.x), y[i] = static_cast<float>(ray.y);
    }
  }
  far = stage_far;
}

void PixelRays::set_background(std::span<const std::uint16_t> depth) {
  if (!depth.empty() && depth.size() != far.size())
    throw std::invalid_argument("a background image of " + std::to_string(depth.size()) + " pixels for a camera of " + std::to_string(width) + " x " +
                                std::to_string(height) + "; record it again");
  far = stage_far;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (depth[i] < min_count || depth[i] > max_count) continue;
    const double metres = static_cast<double>(depth[i]) * scale + offset;
    const double limit = metres - std::max(static_cast<double>(background_margin_), background_relative_ * metres);
    far[i] = std::min(far[i], clamp_count(std::floor((limit - offset) / scale)));
  }
}

}  // namespace booth::fit

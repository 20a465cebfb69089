// Newton's iteration on the lens model, once per pixel and device.
#include "drivers/kinect2/lens.hpp"

#include <cmath>

#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {
namespace {

bool undistort(const DepthCameraParameters& p, double xd, double yd, double& x, double& y) {
  x = xd;
  y = yd;
  for (int i = 0; i < 25; ++i) {
    const double r2 = x * x + y * y;
    const double kr = 1 + r2 * (p.k1 + r2 * (p.k2 + r2 * p.k3));
    const double dk = p.k1 + r2 * (2 * p.k2 + r2 * 3 * p.k3);  // d kr / d r2
    const double ex = x * kr + 2 * p.p1 * x * y + p.p2 * (r2 + 2 * x * x) - xd;
    const double ey = y * kr + 2 * p.p2 * x * y + p.p1 * (r2 + 2 * y * y) - yd;
    if (ex * ex + ey * ey < 1e-24) return true;
    const double a = kr + 2 * x * x * dk + 2 * p.p1 * y + 6 * p.p2 * x, b = 2 * x * y * dk + 2 * p.p1 * x + 2 * p.p2 * y;
    const double c = 2 * x * y * dk + 2 * p.p2 * y + 2 * p.p1 * x, d = kr + 2 * y * y * dk + 2 * p.p2 * x + 6 * p.p1 * y;
    const double det = a * d - b * c;
    if (!(std::abs(det) > 1e-9)) return false;
    x -= (d * ex - b * ey) / det;
    y -= (a * ey - c * ex) / det;
    if (!(x * x + y * y < 9)) return false;
  }
  return false;
}

}  // namespace

RayTable make_ray_table(const DepthCameraParameters& p) {
  RayTable table;
  table.xu.assign(kPixels, 0);
  table.yu.assign(kPixels, 0);
  table.s.assign(kPixels, 0);
  for (int r = 0; r < kHeight; ++r)
    for (int c = 0; c < kWidth; ++c) {
      double x = 0, y = 0;
      if (!undistort(p, (c + 0.5 - p.cx) / p.fx, (r + 0.5 - p.cy) / p.fy, x, y)) continue;
      const auto i = static_cast<std::size_t>(r * kWidth + c);
      table.xu[i] = static_cast<float>(x);
      table.yu[i] = static_cast<float>(y);
      table.s[i] = static_cast<float>(std::sqrt(1 + x * x + y * y));
    }
  return table;
}

}  // namespace booth::drivers::kinect2

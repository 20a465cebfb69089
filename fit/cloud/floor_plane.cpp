// The fullest centimetre starts it, three least-squares rounds with a narrowing band finish it.
#include "fit/cloud/floor_plane.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

namespace booth::fit {

FloorPlane fit_floor(std::span<const Eigen::Vector3f> points) {
  constexpr int kMinimum = 200;
  constexpr float kBin = 0.01f, kMaxHeight = 0.08f, kMaxSlope = 0.035f;
  constexpr int kBins = static_cast<int>(2 * kFloorSearch / kBin + 0.5f);
  if (points.size() < kMinimum) return {};

  std::array<int, kBins> histogram{};
  for (const Eigen::Vector3f& p : points)
    if (std::abs(p.y()) < kFloorSearch) ++histogram[static_cast<std::size_t>(std::min(static_cast<int>((p.y() + kFloorSearch) / kBin), kBins - 1))];
  const auto mode = std::max_element(histogram.begin(), histogram.end()) - histogram.begin();

  FloorPlane plane;
  plane.height = (static_cast<float>(mode) + 0.5f) * kBin - kFloorSearch;
  for (const float band : {0.06f, 0.035f, 0.025f}) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    double squares = 0;
    int count = 0;
    for (const Eigen::Vector3f& p : points) {
      const float residual = plane.above(p.x(), p.y(), p.z());
      if (!(std::abs(residual) < band)) continue;
      const Eigen::Vector3d row(1, p.x(), p.z());
      normal += row * row.transpose();
      right += row * static_cast<double>(p.y());
      squares += static_cast<double>(residual) * residual;
      ++count;
    }
    if (count < kMinimum) return {};
    // A floor seen in one corner only must not tilt on its noise: slopes are known to about 0.01 beforehand, points to about 0.01 m.
    normal(1, 1) += 1;
    normal(2, 2) += 1;
    const Eigen::Vector3d solution = normal.ldlt().solve(right);
    plane.height = static_cast<float>(solution[0]), plane.slope_x = static_cast<float>(solution[1]), plane.slope_z = static_cast<float>(solution[2]);
    plane.sigma = static_cast<float>(std::sqrt(squares / count));
  }
  if (!(std::abs(plane.height) < kMaxHeight && std::abs(plane.slope_x) < kMaxSlope && std::abs(plane.slope_z) < kMaxSlope)) return {};
  plane.measured = true;
  return plane;
}

}  // namespace booth::fit

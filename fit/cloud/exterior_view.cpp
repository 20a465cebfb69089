// Rays from every occupied voxel, one step a cell, until they leave the grid or meet the cloud.
#include "fit/cloud/exterior_view.hpp"

#include <algorithm>
#include <cmath>

namespace booth::fit {
namespace {

constexpr float kCellPerSpacing = 2.5f;  // gaps between points must not look like holes
constexpr float kSmallestCell = 0.02f;   // m; limbs are wider
constexpr double kMostCells = 8e6;
constexpr float kFirstStep = 2.2f;  // cells; a ray has to get away from the surface on which it starts
constexpr float kStep = 0.9f;
constexpr float kGrazing = 0.4f;  // cosine; flatter rays meet the surface on which they start

}  // namespace

ExteriorView::ExteriorView(const std::vector<Eigen::Vector3f>& points, float spacing) {
  low_ = points.front();
  Eigen::Vector3f high = low_;
  for (const auto& p : points) low_ = low_.cwiseMin(p), high = high.cwiseMax(p);
  const Eigen::Vector3f extent = high - low_;
  cell_ = std::max(kCellPerSpacing * spacing, kSmallestCell);
  const auto cells = [&](float c) {
    return (static_cast<double>(extent.x() / c) + 1) * (static_cast<double>(extent.y() / c) + 1) * (static_cast<double>(extent.z() / c) + 1);
  };
  while (cells(cell_) > kMostCells) cell_ *= 1.25f;
  for (int k = 0; k < 3; ++k) n_[k] = static_cast<int>(extent[k] / cell_) + 1;
  entry_.assign(static_cast<std::size_t>(n_[0]) * static_cast<std::size_t>(n_[1]) * static_cast<std::size_t>(n_[2]), -1);
  for (const auto& p : points) entry_[cell_of(p)] = 0;

  // A spiral over the sphere. The golden angle's sine and cosine are multiplied up, so that the directions have the same bits on every machine.
  constexpr float kCos = -0.73736888f, kSin = 0.67549029f;
  float c = 1, s = 0;
  for (int k = 0; k < kDirections; ++k) {
    const float y = 1 - (2 * static_cast<float>(k) + 1) / kDirections, r = std::sqrt(std::max(0.0f, 1 - y * y));
    direction_.emplace_back(Eigen::Vector3f(r * c, y, r * s).normalized());
    const float next = c * kCos - s * kSin;
    s = s * kCos + c * kSin;
    c = next;
  }

  for (int z = 0; z < n_[2]; ++z)
    for (int y = 0; y < n_[1]; ++y)
      for (int x = 0; x < n_[0]; ++x) {
        auto& entry = entry_[static_cast<std::size_t>((z * n_[1] + y) * n_[0] + x)];
        if (entry < 0) continue;
        const Eigen::Vector3f from(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f, static_cast<float>(z) + 0.5f);
        std::uint64_t open = 0;
        for (int k = 0; k < kDirections; ++k) {
          for (float t = kFirstStep;; t += kStep) {
            const Eigen::Vector3f at = from + t * direction_[static_cast<std::size_t>(k)];
            const int i[3] = {static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y())), static_cast<int>(std::floor(at.z()))};
            if (i[0] < 0 || i[1] < 0 || i[2] < 0 || i[0] >= n_[0] || i[1] >= n_[1] || i[2] >= n_[2]) {
              open |= std::uint64_t{1} << k;
              break;
            }
            if (entry_[static_cast<std::size_t>((i[2] * n_[1] + i[1]) * n_[0] + i[0])] >= 0) break;
          }
        }
        entry = static_cast<std::int32_t>(open_.size());
        open_.push_back(open);
      }
}

std::size_t ExteriorView::cell_of(const Eigen::Vector3f& p) const {
  const Eigen::Vector3f local = (p - low_) / cell_;
  int i[3];
  for (int k = 0; k < 3; ++k) i[k] = std::clamp(static_cast<int>(local[k]), 0, n_[k] - 1);
  return static_cast<std::size_t>((i[2] * n_[1] + i[1]) * n_[0] + i[0]);
}

float ExteriorView::openness(const Eigen::Vector3f& p, const Eigen::Vector3f& normal) const {
  const std::int32_t entry = entry_[cell_of(p)];
  if (entry < 0) return 0;
  const std::uint64_t open = open_[static_cast<std::size_t>(entry)];
  float before = 0, behind = 0, all_before = 1e-6f, all_behind = 1e-6f;
  for (int k = 0; k < kDirections; ++k) {
    const float cosine = normal.dot(direction_[static_cast<std::size_t>(k)]);
    const float is_open = static_cast<float>(open >> k & 1);
    if (cosine > kGrazing) all_before += cosine, before += cosine * is_open;
    if (cosine < -kGrazing) all_behind -= cosine, behind -= cosine * is_open;
  }
  return before / all_before - behind / all_behind;
}

}  // namespace booth::fit

// Counting sort into cells, and a search over growing cubes of cells that stops as soon as nothing nearer can follow.
#include "fit/cloud/point_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace booth::fit {
namespace {

constexpr int kMaxCells = 1 << 16;
constexpr float kBodyArea = 1.9f;  // m^2

// No stage is a kilometre wide: coordinates beyond that are broken, as NaN is, and would overflow the arithmetic below.
bool usable(float x, float y, float z) { return std::abs(x) < 1000 && std::abs(y) < 1000 && std::abs(z) < 1000; }

}  // namespace

PointGrid::PointGrid(int capacity, float cell) {
  if (capacity < 1 || capacity > 10'000'000) throw std::invalid_argument("point grid: capacity " + std::to_string(capacity) + "; give 1 to 10000000 points");
  if (!(cell >= 0) || cell > 10) throw std::invalid_argument("point grid: cells of " + std::to_string(cell) + " m; give a size up to 10 m, or 0 for automatic");
  wanted_cell_ = cell > 0 ? cell : std::clamp(1.8f * std::sqrt(kBodyArea / static_cast<float>(capacity)), 0.01f, 0.12f);
  sorted_.resize(static_cast<std::size_t>(capacity));
  sorted_normal_.resize(static_cast<std::size_t>(capacity));
  cell_of_.resize(static_cast<std::size_t>(capacity));
  start_.resize(kMaxCells + 1);
}

std::size_t PointGrid::memory_bytes() const {
  return sorted_.size() * (sizeof(Entry) + sizeof(Normal) + sizeof(std::int32_t)) + start_.size() * sizeof(std::int32_t);
}

void PointGrid::rebuild(const float* x, const float* y, const float* z, const float* nx, const float* ny, const float* nz, int n) {
  n = std::clamp(n, 0, capacity());
  has_normals_ = nx != nullptr;
  constexpr float kHuge = std::numeric_limits<float>::max();
  Eigen::Vector3f low(kHuge, kHuge, kHuge), high(-kHuge, -kHuge, -kHuge);
  int usable_points = 0;
  for (int i = 0; i < n; ++i) {
    if (!usable(x[i], y[i], z[i])) continue;
    const Eigen::Vector3f p(x[i], y[i], z[i]);
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
    ++usable_points;
  }
  count_ = usable_points;
  nx_ = ny_ = nz_ = 0;
  if (usable_points == 0) return;

  // Points far apart make the cells larger.
  const Eigen::Vector3d extent = high.cast<double>() - low.cast<double>();
  double cell = wanted_cell_;
  const auto cells = [&](double size) {
    return (std::floor(extent.x() / size) + 1) * (std::floor(extent.y() / size) + 1) * (std::floor(extent.z() / size) + 1);
  };
  while (cells(cell) > kMaxCells) cell *= 1.25;
  cell_ = static_cast<float>(cell);
  inverse_cell_ = static_cast<float>(1 / cell);
  origin_ = low;
  nx_ = static_cast<int>(extent.x() / cell) + 1, ny_ = static_cast<int>(extent.y() / cell) + 1, nz_ = static_cast<int>(extent.z() / cell) + 1;

  std::fill_n(start_.begin(), nx_ * ny_ * nz_ + 1, 0);
  for (int i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!usable(x[i], y[i], z[i])) {
      cell_of_[k] = -1;
      continue;
    }
    const int cx = std::min(static_cast<int>((x[i] - origin_.x()) * inverse_cell_), nx_ - 1);
    const int cy = std::min(static_cast<int>((y[i] - origin_.y()) * inverse_cell_), ny_ - 1);
    const int cz = std::min(static_cast<int>((z[i] - origin_.z()) * inverse_cell_), nz_ - 1);
    cell_of_[k] = (cz * ny_ + cy) * nx_ + cx;
    ++start_[static_cast<std::size_t>(cell_of_[k])];
  }
  // Running sums give each cell's end; filling backwards turns the ends into beginnings and keeps the order of the points within a cell.
  std::int32_t sum = 0;
  for (int c = 0; c < nx_ * ny_ * nz_; ++c) start_[static_cast<std::size_t>(c)] = sum += start_[static_cast<std::size_t>(c)];
  start_[static_cast<std::size_t>(nx_ * ny_ * nz_)] = sum;
  for (int i = n - 1; i >= 0; --i) {
    const std::int32_t c = cell_of_[static_cast<std::size_t>(i)];
    if (c < 0) continue;
    const auto at = static_cast<std::size_t>(--start_[static_cast<std::size_t>(c)]);
    sorted_[at] = {x[i], y[i], z[i], i};
    if (has_normals_) sorted_normal_[at] = {nx[i], ny[i], nz[i], 0};
  }
}

template <typename Gate>
int PointGrid::search(const Eigen::Vector3f& p, float max_distance, Gate gate) const {
  if (count_ == 0 || !(max_distance > 0)) return -1;
  const Eigen::Vector3f local = (p - origin_) * inverse_cell_;  // in cells
  // Beyond this the grid is out of reach; it also keeps the conversions to int below in range, and NaN out.
  const float reach = std::min(max_distance * inverse_cell_, 1e6f);
  if (!(local.x() > -reach && local.y() > -reach && local.z() > -reach && local.x() < reach + static_cast<float>(nx_) &&
        local.y() < reach + static_cast<float>(ny_) && local.z() < reach + static_cast<float>(nz_)))
    return -1;
  const int cx = static_cast<int>(std::floor(local.x())), cy = static_cast<int>(std::floor(local.y())), cz = static_cast<int>(std::floor(local.z()));
  const float fx = local.x() - static_cast<float>(cx), fy = local.y() - static_cast<float>(cy), fz = local.z() - static_cast<float>(cz);
  // How far p is from the nearest face of its own cell: a cube of cells with `r` cells on each side of it reaches at least r + margin cells.
  const float margin = std::min({fx, 1 - fx, fy, 1 - fy, fz, 1 - fz});
  const float cell2 = cell_ * cell_;

  float best = max_distance * max_distance;
  int found = -1;
  const auto scan = [&](int y, int z, int x0, int x1) {
    x0 = std::max(x0, 0);
    x1 = std::min(x1, nx_ - 1);
    if (x0 > x1) return;
    const auto row = static_cast<std::size_t>((z * ny_ + y) * nx_);
    const auto end = static_cast<std::size_t>(start_[row + static_cast<std::size_t>(x1) + 1]);
    for (auto e = static_cast<std::size_t>(start_[row + static_cast<std::size_t>(x0)]); e < end; ++e) {
      const Entry& entry = sorted_[e];
      const float dx = entry.x - p.x(), dy = entry.y - p.y(), dz = entry.z - p.z();
      const float d = dx * dx + dy * dy + dz * dz;
      if (d < best && gate(e)) best = d, found = entry.index;
    }
  };
  // Distance in cells from p to the layer of cells at offset k along one axis.
  const auto gap = [](int k, float f) { return k == 0 ? 0.0f : k > 0 ? static_cast<float>(k) - f : f - static_cast<float>(k) - 1; };

  // Cubes that end before the grid begins are empty: start with the first that touches it.
  const auto outside = [](int c, int n) { return c < 0 ? -c : c >= n ? c - n + 1 : 0; };
  const int first = std::max({outside(cx, nx_), outside(cy, ny_), outside(cz, nz_)});
  const int last = std::max({std::max(cx, nx_ - 1 - cx), std::max(cy, ny_ - 1 - cy), std::max(cz, nz_ - 1 - cz)});
  for (int r = first; r <= last; ++r) {
    const float bound = std::max(static_cast<float>(r - 1) + margin, 0.0f);
    if (r > 0 && bound * bound * cell2 >= best) break;
    for (int z = std::max(cz - r, 0); z <= std::min(cz + r, nz_ - 1); ++z) {
      const float gz = gap(z - cz, fz);
      if (gz * gz * cell2 >= best) continue;
      for (int y = std::max(cy - r, 0); y <= std::min(cy + r, ny_ - 1); ++y) {
        const float gy = gap(y - cy, fy);
        if ((gy * gy + gz * gz) * cell2 >= best) continue;
        if (r == 0 || z == cz - r || z == cz + r || y == cy - r || y == cy + r) {
          scan(y, z, cx - r, cx + r);
        } else {
          scan(y, z, cx - r, cx - r);
          scan(y, z, cx + r, cx + r);
        }
      }
    }
  }
  return found;
}

int PointGrid::nearest(const Eigen::Vector3f& p, float max_distance) const {
  return search(p, max_distance, [](std::size_t) { return true; });
}

int PointGrid::nearest(const Eigen::Vector3f& p, float max_distance, const Eigen::Vector3f& normal, float min_cosine) const {
  if (!has_normals_) return -1;
  return search(p, max_distance, [&](std::size_t e) {
    const Normal& n = sorted_normal_[e];
    return n.x * normal.x() + n.y * normal.y() + n.z * normal.z() > min_cosine;
  });
}

}  // namespace booth::fit

// First version: exact enough and simple, over a dense field of the same cells.
#include "fit/cloud/brick_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "fit/swarm/lanes.hpp"

namespace booth::fit {

BrickField::BrickField(const BrickFieldSettings& settings)
    : settings_(settings), inner_({.cell = settings.cell, .band = settings.band, .max_points = settings.max_points, .max_cells = 64 * settings.max_bricks}) {
  brick_.assign(static_cast<std::size_t>(settings.max_bricks), -1);
  cell_.assign(1 + static_cast<std::size_t>(settings.max_fine_bricks) * kBrickCells + static_cast<std::size_t>(settings.max_bricks), kNoPoint);
  view_.brick = brick_.data(), view_.cell = cell_.data();
  view_.brick_strides = 1 | 1 << 16;
}

std::size_t BrickField::memory_bytes() const { return (brick_.size() + cell_.size()) * sizeof(std::int32_t) + inner_.memory_bytes(); }

void BrickField::rebuild(const Cloud& cloud, WorkerPool& pool) {
  inner_.rebuild(cloud, pool);
  Eigen::Vector3f low = Eigen::Vector3f::Constant(1e9f), high = -low;
  const int n = std::min(cloud.size, settings_.max_points);
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3f p(cloud.x[i], cloud.y[i], cloud.z[i]);
    if (!(p.cwiseAbs().maxCoeff() < 1000)) continue;
    low = low.cwiseMin(p), high = high.cwiseMax(p);
  }
  fine_bricks_ = 0;
  bricks_ = 1, brick_[0] = -1, cell_[0] = kNoPoint;
  view_.brick_strides = 1 | 1 << 16;
  for (float& l : view_.last) l = 0;
  if (!(low.x() <= high.x())) return;
  const float cell = inner_.cell(), edge = cell * kBrick;
  const int layers = static_cast<int>(settings_.band / edge) + 2;
  int count[3];
  for (int c = 0; c < 3; ++c) {
    count[c] = static_cast<int>((high[c] - low[c]) / edge) + 1 + 2 * layers;
    view_.origin[c] = low[c] - static_cast<float>(layers) * edge;
    view_.last[c] = static_cast<float>(count[c] * kBrick) - 0.5f;
  }
  if (count[0] * count[1] > 32767 || static_cast<std::int64_t>(count[0]) * count[1] * count[2] > settings_.max_bricks) {
    for (float& l : view_.last) l = 0;
    return;
  }
  bricks_ = count[0] * count[1] * count[2];
  view_.cell_size = cell, view_.inverse_cell = 1 / cell;
  view_.brick_strides = count[0] | (count[0] * count[1]) << 16;
  const float reach = settings_.band + edge * 1.5f;
  view_.step = reach / cell / kOffsetLimit;
  const Eigen::Vector3f origin(view_.origin[0], view_.origin[1], view_.origin[2]);
  std::int32_t used = 1;
  const auto pack = [&](const Eigen::Vector3f& corner, int i) {
    int o[3];
    for (int c = 0; c < 3; ++c) {
      const float p = c == 0 ? cloud.x[i] : c == 1 ? cloud.y[i] : cloud.z[i];
      o[c] = static_cast<int>(std::nearbyint((p - corner[c]) / (cell * view_.step)));
      if (std::abs(o[c]) > kOffsetLimit) return kNoPoint;
    }
    return pack_offset(o[0], o[1], o[2]);
  };
  int b = 0;
  for (int z = 0; z < count[2]; ++z)
    for (int y = 0; y < count[1]; ++y)
      for (int x = 0; x < count[0]; ++x, ++b) {
        const Eigen::Vector3f corner = origin + edge * Eigen::Vector3f(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
        const Eigen::Vector3f centre = corner + Eigen::Vector3f::Constant(edge / 2);
        const bool border = x == 0 || y == 0 || z == 0 || x == count[0] - 1 || y == count[1] - 1 || z == count[2] - 1;
        const int i = border ? -1 : inner_.nearest_refined(cloud, centre);
        brick_[b] = -1;  // ~0: the cell that has no point
        if (i < 0) continue;
        const float d = (Eigen::Vector3f(cloud.x[i], cloud.y[i], cloud.z[i]) - centre).norm();
        if (d > settings_.fine || fine_bricks_ == settings_.max_fine_bricks) {
          brick_[b] = ~used;
          cell_[used++] = pack(corner, i);
          continue;
        }
        ++fine_bricks_;
        brick_[b] = used;
        for (int k = 0; k < kBrickCells; ++k) {
          const Eigen::Vector3f at =
              corner + cell * Eigen::Vector3f(static_cast<float>(k & 3) + 0.5f, static_cast<float>(k >> 2 & 3) + 0.5f, static_cast<float>(k >> 4) + 0.5f);
          const int j = inner_.nearest(at);
          cell_[used++] = j < 0 ? kNoPoint : pack(corner, j);
        }
      }
}

bool BrickField::nearest(const Eigen::Vector3f& p, Eigen::Vector3f& out) const {
  const FieldView& f = view_;
  Eigen::Vector3f d;
  for (int c = 0; c < 3; ++c) d[c] = (p[c] - f.origin[c]) * f.inverse_cell;
  if (field_difference<ScalarLanes>(f, d[0], d[1], d[2])) return false;
  out = p - d * f.cell_size;
  return true;
}

}  // namespace booth::fit

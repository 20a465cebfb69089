// Thins the cloud to one point a cell, finds each brick's nearest point on the coarse grid of bricks, then that of each cell of the bricks near the cloud.
#include "fit/cloud/brick_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "fit/kernel.hpp"
#include "fit/swarm/lanes.hpp"

namespace booth::fit {
namespace {

constexpr int kTasks = 32;
constexpr float kUsable = 1000;  // m
constexpr int kMostNeighbours = 5 * 5 * 5;
constexpr int kCandidates = 4096;  // of one brick; those beyond are left out

/// Brick and cell of each point in [begin, end), as brick * 64 + cell, or -1 for points that are not usable.
BOOTH_KERNEL void find_keys(const float* x, const float* y, const float* z, int begin, int end, const float* origin, float inverse_cell, const int* bricks,
                            std::int32_t* key) {
  const float ox = origin[0], oy = origin[1], oz = origin[2];
  const float lx = static_cast<float>(4 * bricks[0] - 1), ly = static_cast<float>(4 * bricks[1] - 1), lz = static_cast<float>(4 * bricks[2] - 1);
  const std::int32_t nx = bricks[0], ny = bricks[1];
  for (int i = begin; i < end; ++i) {
    const bool good = std::abs(x[i]) < kUsable && std::abs(y[i]) < kUsable && std::abs(z[i]) < kUsable;
    float fx = good ? (x[i] - ox) * inverse_cell : 0, fy = good ? (y[i] - oy) * inverse_cell : 0, fz = good ? (z[i] - oz) * inverse_cell : 0;
    fx = fx < lx ? fx : lx, fy = fy < ly ? fy : ly, fz = fz < lz ? fz : lz;
    const std::int32_t ix = static_cast<std::int32_t>(fx), iy = static_cast<std::int32_t>(fy), iz = static_cast<std::int32_t>(fz);
    const std::int32_t at = (((iz >> 2) * ny + (iy >> 2)) * nx + (ix >> 2)) * 64 + (ix & 3) + (iy & 3) * 4 + (iz & 3) * 16;
    key[i] = good ? at : -1;
  }
}

/// Least and greatest coordinate among the usable points of [begin, end).
BOOTH_KERNEL void find_range(const float* v, const float* x, const float* y, const float* z, int begin, int end, float* low, float* high) {
  constexpr int kLanes = 16;
  float least[kLanes], most[kLanes];
  for (int k = 0; k < kLanes; ++k) least[k] = std::numeric_limits<float>::max(), most[k] = -std::numeric_limits<float>::max();
  int i = begin;
  for (; i + kLanes <= end; i += kLanes)
    for (int k = 0; k < kLanes; ++k) {
      const bool good = std::abs(x[i + k]) < kUsable && std::abs(y[i + k]) < kUsable && std::abs(z[i + k]) < kUsable;
      const float a = good ? v[i + k] : std::numeric_limits<float>::max(), b = good ? v[i + k] : -std::numeric_limits<float>::max();
      least[k] = a < least[k] ? a : least[k], most[k] = b > most[k] ? b : most[k];
    }
  for (; i < end; ++i) {
    const bool good = std::abs(x[i]) < kUsable && std::abs(y[i]) < kUsable && std::abs(z[i]) < kUsable;
    if (good) least[0] = std::min(least[0], v[i]), most[0] = std::max(most[0], v[i]);
  }
  for (int k = 0; k < kLanes; ++k) *low = std::min(*low, least[k]), *high = std::max(*high, most[k]);
}

/// Squared distance of points from a box, 0 inside.
BOOTH_KERNEL void box_distance2(const float* x, const float* y, const float* z, int count, const float* low, const float* high, float* out) {
  const float lx = low[0], ly = low[1], lz = low[2], hx = high[0], hy = high[1], hz = high[2];
  for (int i = 0; i < count; ++i) {
    float dx = lx - x[i] > x[i] - hx ? lx - x[i] : x[i] - hx, dy = ly - y[i] > y[i] - hy ? ly - y[i] : y[i] - hy;
    float dz = lz - z[i] > z[i] - hz ? lz - z[i] : z[i] - hz;
    dx = dx > 0 ? dx : 0, dy = dy > 0 ? dy : 0, dz = dz > 0 ? dz : 0;
    out[i] = dx * dx + dy * dy + dz * dz;
  }
}

/// The nearest of `count` points to each of a brick's 64 cell centres. (x, y, z) are relative to the first cell's centre, in cells.
BOOTH_KERNEL void nearest_of_cells(const float* x, const float* y, const float* z, int count, float* best, std::int32_t* which) {
  constexpr int kLayer = 16;
  float cx[kLayer], cy[kLayer];
  for (int k = 0; k < kLayer; ++k) cx[k] = static_cast<float>(k & 3), cy[k] = static_cast<float>(k >> 2);
  float best0[kLayer], best1[kLayer], best2[kLayer], best3[kLayer];
  std::int32_t which0[kLayer], which1[kLayer], which2[kLayer], which3[kLayer];
  for (int k = 0; k < kLayer; ++k) best0[k] = best1[k] = best2[k] = best3[k] = 1e30f, which0[k] = which1[k] = which2[k] = which3[k] = -1;
  for (int i = 0; i < count; ++i) {
    const float px = x[i], py = y[i], pz = z[i];
    const float z0 = pz * pz, z1 = (pz - 1) * (pz - 1), z2 = (pz - 2) * (pz - 2), z3 = (pz - 3) * (pz - 3);
    for (int k = 0; k < kLayer; ++k) {
      const float dx = px - cx[k], dy = py - cy[k], across = dx * dx + dy * dy;
      const float d0 = across + z0, d1 = across + z1, d2 = across + z2, d3 = across + z3;
      which0[k] = d0 < best0[k] ? i : which0[k], best0[k] = d0 < best0[k] ? d0 : best0[k];
      which1[k] = d1 < best1[k] ? i : which1[k], best1[k] = d1 < best1[k] ? d1 : best1[k];
      which2[k] = d2 < best2[k] ? i : which2[k], best2[k] = d2 < best2[k] ? d2 : best2[k];
      which3[k] = d3 < best3[k] ? i : which3[k], best3[k] = d3 < best3[k] ? d3 : best3[k];
    }
  }
  for (int k = 0; k < kLayer; ++k) {
    best[k] = best0[k], best[kLayer + k] = best1[k], best[2 * kLayer + k] = best2[k], best[3 * kLayer + k] = best3[k];
    which[k] = which0[k], which[kLayer + k] = which1[k], which[2 * kLayer + k] = which2[k], which[3 * kLayer + k] = which3[k];
  }
}

NearestFieldSettings coarse(const BrickFieldSettings& s) {
  const float edge = s.cell * kBrick;
  // A layer of bricks beyond the band on every side never answers: clamped look-ups end there.
  return {.cell = edge, .band = s.band + 1.8f * edge, .max_points = s.max_points, .max_cells = s.max_bricks, .max_plane = 32767};
}

void check(const BrickFieldSettings& s) {
  const auto need = [](bool good, const char* what) {
    if (!good) throw std::invalid_argument(std::string("nearest-point field: ") + what);
  };
  need(s.cell >= 0.002f && s.cell <= 0.25f, "cell must be 0.002 to 0.25 m");
  need(s.band > 0 && s.band <= 2, "band must be above 0 and at most 2 m");
  need(s.fine >= 0 && s.fine <= s.band, "fine must be 0 to the band");
  need(s.max_points >= 1 && s.max_points <= 10'000'000, "max_points must be 1 to 10000000");
  need(s.max_bricks >= 4096 && s.max_bricks <= 10'000'000, "max_bricks must be 4096 to 10000000");
  need(s.max_fine_bricks >= 0 && s.max_fine_bricks <= s.max_bricks, "max_fine_bricks must be 0 to max_bricks");
}

}  // namespace

BrickField::BrickField(const BrickFieldSettings& settings)
    : settings_((check(settings), settings)), coarse_(coarse(settings)), thin_(settings.max_points) {
  const auto points = static_cast<std::size_t>(settings.max_points), bricks = static_cast<std::size_t>(settings.max_bricks);
  brick_.assign(bricks, -1);
  cell_.assign(1 + static_cast<std::size_t>(settings.max_fine_bricks) * kBrickCells + bricks, kNoPoint);
  key_.resize(points), sorted_.resize(points);
  for (auto* v : {&kept_x_, &kept_y_, &kept_z_}) v->resize(points);
  start_.resize(bricks + 1), kept_.resize(bricks), middle_.resize(bricks);
  occupied_.resize(std::min(points, bricks)), fine_.resize(static_cast<std::size_t>(settings.max_fine_bricks));
  for (Scratch& s : scratch_)
    for (auto* v : {&s.x, &s.y, &s.z, &s.distance2}) v->resize(kCandidates);
  view_.brick = brick_.data(), view_.cell = cell_.data();
  clear();
}

std::size_t BrickField::memory_bytes() const {
  return (brick_.size() + cell_.size() + key_.size() + sorted_.size() + start_.size() + kept_.size() + middle_.size() + occupied_.size() + fine_.size() +
          kept_x_.size() * 3 + thin_.x.size() * 6 + std::size(scratch_) * 4 * kCandidates) *
             sizeof(float) +
         coarse_.memory_bytes();
}

void BrickField::clear() {
  bricks_ = 1, fine_bricks_ = 0;
  brick_[0] = -1, cell_[0] = kNoPoint;
  view_.brick_strides = 1 | 1 << 16;
  for (float& l : view_.last) l = 0;
}

void BrickField::rebuild(const Cloud& cloud, WorkerPool& pool) {
  const int n = std::min(cloud.size, settings_.max_points);
  clear();
  Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::max()), high = -low;
  const float* axis[3] = {cloud.x.data(), cloud.y.data(), cloud.z.data()};
  pool.run(3, [&](int c) { find_range(axis[c], axis[0], axis[1], axis[2], 0, n, &low[c], &high[c]); });
  if (!(low.x() <= high.x())) return;
  if (!coarse_.set_box(low, high)) return;
  const Eigen::Vector3i count = coarse_.cells();
  const float edge = coarse_.cell(), cell = edge / kBrick;
  bricks_ = count.prod();
  view_.cell_size = cell, view_.inverse_cell = 1 / cell;
  view_.brick_strides = count[0] | (count[0] * count[1]) << 16;
  for (int c = 0; c < 3; ++c) view_.origin[c] = coarse_.origin()[c], view_.last[c] = static_cast<float>(count[c] * kBrick) - 0.5f;
  view_.step = (settings_.band + 2 * edge) / cell / kOffsetLimit;

  sort_points(cloud, n, pool);
  thin(cloud, pool);
  coarse_.fill(thin_, pool);
  describe_bricks(pool);
  pool.run(fine_bricks_ > 0 ? kTasks : 0, [&](int task) {
    const Range r = block_range(fine_bricks_, kTasks, task);
    for (int i = r.begin; i < r.end; ++i) describe_cells(fine_[static_cast<std::size_t>(i)], scratch_[task]);
  });
}

void BrickField::sort_points(const Cloud& cloud, int n, WorkerPool& pool) {
  const Eigen::Vector3i count = coarse_.cells();
  pool.run(kTasks, [&](int task) {
    const Range r = block_range(n, kTasks, task);
    find_keys(cloud.x.data(), cloud.y.data(), cloud.z.data(), r.begin, r.end, view_.origin, view_.inverse_cell, count.data(), key_.data());
    const Range b = block_range(bricks_ + 1, kTasks, task);
    std::fill(start_.begin() + b.begin, start_.begin() + b.end, 0);
  });
  for (int i = 0; i < n; ++i)
    if (const std::int32_t key = key_[static_cast<std::size_t>(i)]; key >= 0) ++start_[static_cast<std::size_t>(key >> 6)];
  std::int32_t sum = 0;
  occupied_count_ = 0;
  for (int b = 0; b < bricks_; ++b) {
    std::int32_t& s = start_[static_cast<std::size_t>(b)];
    if (s > 0) occupied_[static_cast<std::size_t>(occupied_count_++)] = b;
    s = sum += s;  // the end for now; the points, taken from the last, bring it down to the beginning
  }
  start_[static_cast<std::size_t>(bricks_)] = sum;
  for (int i = n - 1; i >= 0; --i)
    if (const std::int32_t key = key_[static_cast<std::size_t>(i)]; key >= 0)
      sorted_[static_cast<std::size_t>(--start_[static_cast<std::size_t>(key >> 6)])] = i;
}

void BrickField::thin(const Cloud& cloud, WorkerPool& pool) {
  const Eigen::Vector3i count = coarse_.cells();
  const float cell = view_.cell_size;
  pool.run(kTasks, [&](int task) {
    const Range r = block_range(occupied_count_, kTasks, task);
    for (int o = r.begin; o < r.end; ++o) {
      const std::int32_t b = occupied_[static_cast<std::size_t>(o)];
      const float corner[3] = {view_.origin[0] + static_cast<float>(b % count[0]) * cell * kBrick,
                               view_.origin[1] + static_cast<float>(b / count[0] % count[1]) * cell * kBrick,
                               view_.origin[2] + static_cast<float>(b / (count[0] * count[1])) * cell * kBrick};
      float best[kBrickCells + 8];
      std::int32_t which[kBrickCells + 8];
      std::fill_n(best, kBrickCells + 8, std::numeric_limits<float>::max());
      std::fill_n(which, kBrickCells + 8, -1);
      const auto first = static_cast<std::size_t>(start_[static_cast<std::size_t>(b)]), last = static_cast<std::size_t>(start_[static_cast<std::size_t>(b) + 1]);
      const auto distance2 = [&](std::size_t i, float x, float y, float z) {
        const float dx = cloud.x[i] - (corner[0] + x * cell), dy = cloud.y[i] - (corner[1] + y * cell), dz = cloud.z[i] - (corner[2] + z * cell);
        return dx * dx + dy * dy + dz * dz;
      };
      for (std::size_t e = first; e < last; ++e) {
        const auto i = static_cast<std::size_t>(sorted_[e]);
        const int c = key_[i] & 63, x = c & 3, y = c >> 2 & 3, z = c >> 4, m = kBrickCells + (x >> 1) + (y >> 1) * 2 + (z >> 1) * 4;
        const float d = distance2(i, static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f, static_cast<float>(z) + 0.5f);
        if (d < best[c]) best[c] = d, which[c] = static_cast<std::int32_t>(i);
        const float f = distance2(i, static_cast<float>((x & 2) + 1), static_cast<float>((y & 2) + 1), static_cast<float>((z & 2) + 1));
        if (f < best[m]) best[m] = f, which[m] = static_cast<std::int32_t>(i);
      }
      // Where the brick's points were, first those that cells keep, then those that blocks of eight cells keep. Both lists together may be longer than
      // the points are many: the second then starts again at the front, where it repeats what is there.
      std::size_t out = first;
      for (int c = 0; c < kBrickCells; ++c)
        if (which[c] >= 0) sorted_[out++] = which[c];
      kept_[static_cast<std::size_t>(b)] = static_cast<std::int32_t>(out - first);
      std::int32_t middle = 0;
      for (int m = kBrickCells; m < kBrickCells + 8; ++m)
        if (which[m] >= 0 && out < last) sorted_[out++] = which[m], ++middle;
      middle_[static_cast<std::size_t>(b)] = middle;
      for (std::size_t e = first; e < out; ++e) {
        const auto i = static_cast<std::size_t>(sorted_[e]);
        kept_x_[e] = cloud.x[i], kept_y_[e] = cloud.y[i], kept_z_[e] = cloud.z[i];
      }
    }
  });
  thin_.size = 0;
  for (int o = 0; o < occupied_count_; ++o) {
    const Span s = kept(occupied_[static_cast<std::size_t>(o)], true);
    for (std::int32_t e = s.first; e < s.first + s.count; ++e) {
      const auto k = static_cast<std::size_t>(e);
      thin_.push({kept_x_[k], kept_y_[k], kept_z_[k]}, Eigen::Vector3f::Zero(), 0);
    }
  }
}

BrickField::Span BrickField::kept(std::int32_t brick, bool middle) const {
  const auto b = static_cast<std::size_t>(brick);
  const std::int32_t first = start_[b];
  if (start_[b + 1] == first) return {first, 0};
  return middle && middle_[b] > 0 ? Span{first + kept_[b], middle_[b]} : Span{first, kept_[b]};
}

std::int32_t BrickField::pack(const float* corner, float x, float y, float z) const {
  const float per_step = view_.inverse_cell / view_.step;
  const auto whole = [&](float v) { return static_cast<int>(std::floor(v * per_step + 0.5f)); };
  const int a = whole(x - corner[0]), b = whole(y - corner[1]), c = whole(z - corner[2]);
  if (std::max({std::abs(a), std::abs(b), std::abs(c)}) > kOffsetLimit) return kNoPoint;
  return pack_offset(a, b, c);
}

void BrickField::describe_bricks(WorkerPool& pool) {
  const float edge = view_.cell_size * kBrick, half_diagonal = 0.8661f * edge;
  const float band = settings_.band + half_diagonal, fine2 = settings_.fine * settings_.fine;
  // Which bricks have cells, and where: one after the other, so that it does not depend on the threads.
  std::int32_t used = 1 + bricks_;
  const float* d2 = coarse_.distance2();
  const std::int32_t* index = coarse_.index();
  for (int b = 0; b < bricks_; ++b)
    if (index[b] >= 0 && d2[b] <= fine2 && fine_bricks_ < settings_.max_fine_bricks) {
      fine_[static_cast<std::size_t>(fine_bricks_++)] = b;
      brick_[static_cast<std::size_t>(b)] = used;
      used += kBrickCells;
    } else {
      brick_[static_cast<std::size_t>(b)] = ~(1 + b);
    }
  const Eigen::Vector3i count = coarse_.cells();
  pool.run(count[2], [&](int z) {
    const float corner_z = view_.origin[2] + static_cast<float>(z) * edge;
    for (int y = 0; y < count[1]; ++y)
      for (int x = 0; x < count[0]; ++x) {
        const int b = (z * count[1] + y) * count[0] + x;
        if (brick_[static_cast<std::size_t>(b)] >= 0) continue;
        const bool border = x == 0 || y == 0 || z == 0 || x == count[0] - 1 || y == count[1] - 1 || z == count[2] - 1;
        const std::int32_t i = border || d2[b] > band * band ? -1 : index[b];
        const float corner[3] = {view_.origin[0] + static_cast<float>(x) * edge, view_.origin[1] + static_cast<float>(y) * edge, corner_z};
        const auto k = static_cast<std::size_t>(i);
        cell_[static_cast<std::size_t>(1 + b)] = i < 0 ? kNoPoint : pack(corner, thin_.x[k], thin_.y[k], thin_.z[k]);
      }
  });
}

void BrickField::describe_cells(std::int32_t brick, Scratch& s) {
  const Eigen::Vector3i count = coarse_.cells();
  const int bx = brick % count[0], by = brick / count[0] % count[1], bz = brick / (count[0] * count[1]);
  const float cell = view_.cell_size, edge = cell * kBrick;
  const float corner[3] = {view_.origin[0] + static_cast<float>(bx) * edge, view_.origin[1] + static_cast<float>(by) * edge,
                           view_.origin[2] + static_cast<float>(bz) * edge};
  const float distance = std::sqrt(coarse_.distance2()[brick]);
  // Every cell's centre has a point within `reach`; only points so near to the box of the centres matter. Further off, the points may be sparser.
  const float reach = distance + 2.6f * cell;
  const bool sparse = distance > kSparse * edge;
  const float low[3] = {corner[0] + 0.5f * cell, corner[1] + 0.5f * cell, corner[2] + 0.5f * cell};
  const float high[3] = {low[0] + 3 * cell, low[1] + 3 * cell, low[2] + 3 * cell};
  const int layers = 1 + static_cast<int>((reach - 0.5f * cell) / edge);
  int candidates = 0;
  for (int z = std::max(bz - layers, 0); z <= std::min(bz + layers, count[2] - 1); ++z)
    for (int y = std::max(by - layers, 0); y <= std::min(by + layers, count[1] - 1); ++y)
      for (int x = std::max(bx - layers, 0); x <= std::min(bx + layers, count[0] - 1); ++x) {
        const Span span = kept((z * count[1] + y) * count[0] + x, sparse);
        if (span.count == 0) continue;
        const auto from = static_cast<std::size_t>(span.first);
        box_distance2(&kept_x_[from], &kept_y_[from], &kept_z_[from], span.count, low, high, s.distance2.data());
        for (int i = 0; i < span.count && candidates < kCandidates; ++i)
          if (s.distance2[static_cast<std::size_t>(i)] <= reach * reach) {
            const auto to = static_cast<std::size_t>(candidates++), k = from + static_cast<std::size_t>(i);
            s.x[to] = (kept_x_[k] - low[0]) * view_.inverse_cell, s.y[to] = (kept_y_[k] - low[1]) * view_.inverse_cell,
            s.z[to] = (kept_z_[k] - low[2]) * view_.inverse_cell;
          }
      }
  float best[kBrickCells];
  std::int32_t which[kBrickCells];
  nearest_of_cells(s.x.data(), s.y.data(), s.z.data(), candidates, best, which);
  std::int32_t* out = cell_.data() + brick_[static_cast<std::size_t>(brick)];
  // Relative to the brick's corner, in steps.
  const float per_step = 1 / view_.step;
  for (int c = 0; c < kBrickCells; ++c) {
    if (which[c] < 0) {
      out[c] = kNoPoint;
      continue;
    }
    const auto k = static_cast<std::size_t>(which[c]);
    const auto whole = [&](float v) { return static_cast<int>(std::floor((v + 0.5f) * per_step + 0.5f)); };
    out[c] = pack_offset(whole(s.x[k]), whole(s.y[k]), whole(s.z[k]));
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

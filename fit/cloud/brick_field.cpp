// Sorts the points by brick, finds each brick's nearest point on the coarse grid of bricks, then that of each cell of the bricks near the cloud.
#include "fit/cloud/brick_field.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "fit/kernel.hpp"
#include "fit/swarm/lanes.hpp"

namespace booth::fit {
namespace {

constexpr int kTasks = 32;
constexpr float kUsable = 1000;    // m
constexpr int kCandidates = 4096;  // of one brick; those beyond are left out
constexpr std::int32_t kNoCandidate = std::numeric_limits<std::int32_t>::max();
constexpr int kPart = 512;  // points that are sifted at a time

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

/// The nearest of `count` (at most kCandidates) points to each of a brick's 64 cell centres. (x, y, z) are relative to the first cell's centre, in cells.
/// Distance and index are one number: positive floats compare as their bits do, and the index takes the lowest twelve, so that distances that differ by
/// less than 1 in 2,000 are equal.
BOOTH_KERNEL void nearest_of_cells(const float* x, const float* y, const float* z, int count, std::int32_t* best) {
  constexpr int kLayer = 16;
  float cx[kLayer], cy[kLayer];
  for (int k = 0; k < kLayer; ++k) cx[k] = static_cast<float>(k & 3), cy[k] = static_cast<float>(k >> 2);
  std::int32_t best0[kLayer], best1[kLayer], best2[kLayer], best3[kLayer];
  for (int k = 0; k < kLayer; ++k) best0[k] = best1[k] = best2[k] = best3[k] = kNoCandidate;
  for (int i = 0; i < count; ++i) {
    const float px = x[i], py = y[i], pz = z[i];
    const float z0 = pz * pz, z1 = (pz - 1) * (pz - 1), z2 = (pz - 2) * (pz - 2), z3 = (pz - 3) * (pz - 3);
    for (int k = 0; k < kLayer; ++k) {
      const float dx = px - cx[k], dy = py - cy[k], across = dx * dx + dy * dy;
      const std::int32_t d0 = (std::bit_cast<std::int32_t>(across + z0) & ~(kCandidates - 1)) | i;
      const std::int32_t d1 = (std::bit_cast<std::int32_t>(across + z1) & ~(kCandidates - 1)) | i;
      const std::int32_t d2 = (std::bit_cast<std::int32_t>(across + z2) & ~(kCandidates - 1)) | i;
      const std::int32_t d3 = (std::bit_cast<std::int32_t>(across + z3) & ~(kCandidates - 1)) | i;
      best0[k] = d0 < best0[k] ? d0 : best0[k], best1[k] = d1 < best1[k] ? d1 : best1[k];
      best2[k] = d2 < best2[k] ? d2 : best2[k], best3[k] = d3 < best3[k] ? d3 : best3[k];
    }
  }
  for (int k = 0; k < kLayer; ++k) best[k] = best0[k], best[kLayer + k] = best1[k], best[2 * kLayer + k] = best2[k], best[3 * kLayer + k] = best3[k];
}

/// The nearest of the points [first, last) to a place, where one is nearer than *distance2.
BOOTH_KERNEL void nearest_of(const float* x, const float* y, const float* z, std::int32_t first, std::int32_t last, const float* place, float* distance2,
                             std::int32_t* which) {
  constexpr int kLanes = 16;
  const float px = place[0], py = place[1], pz = place[2];
  float best[kLanes];
  std::int32_t at[kLanes];
  for (int k = 0; k < kLanes; ++k) best[k] = *distance2, at[k] = -1;
  for (std::int32_t i = first; i < last; i += kLanes) {
    // The last vector overlaps the one before: looking twice at a point changes nothing.
    const std::int32_t from = last - first < kLanes ? first : i + kLanes > last ? last - kLanes : i;
    const int count = last - first < kLanes ? last - first : kLanes;
    if (count < kLanes) {
      for (int k = 0; k < count; ++k) {
        const float dx = x[from + k] - px, dy = y[from + k] - py, dz = z[from + k] - pz, d = dx * dx + dy * dy + dz * dz;
        if (d < best[k]) best[k] = d, at[k] = from + k;
      }
      continue;
    }
    for (int k = 0; k < kLanes; ++k) {
      const float dx = x[from + k] - px, dy = y[from + k] - py, dz = z[from + k] - pz, d = dx * dx + dy * dy + dz * dz;
      at[k] = d < best[k] ? from + k : at[k];
      best[k] = d < best[k] ? d : best[k];
    }
  }
  for (int k = 0; k < kLanes; ++k)
    if (at[k] >= 0 && best[k] < *distance2) *distance2 = best[k], *which = at[k];
}

NearestFieldSettings coarse(const BrickFieldSettings& s) {
  const float edge = s.cell * kBrick;
  // A layer of bricks beyond the band on every side never answers: clamped look-ups end there.
  return {.cell = edge, .band = s.band, .max_points = s.max_points, .max_cells = s.max_bricks, .margin = 1.8f, .max_plane = 32767};
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

BrickField::BrickField(const BrickFieldSettings& settings) : settings_((check(settings), settings)), coarse_(coarse(settings)), sparse_(settings.max_points) {
  const auto points = static_cast<std::size_t>(settings.max_points), bricks = static_cast<std::size_t>(settings.max_bricks);
  brick_.assign(bricks, -1);
  cell_.assign(1 + static_cast<std::size_t>(settings.max_fine_bricks) * kBrickCells + bricks, kNoPoint);
  key_.resize(points), sorted_.resize(points), of_sparse_.resize(points);
  for (auto* v : {&x_, &y_, &z_}) v->resize(points);
  start_.resize(bricks + 1), sparse_start_.resize(bricks + 1), sparse_count_.resize(bricks);
  occupied_.resize(std::min(points, bricks)), fine_.resize(static_cast<std::size_t>(settings.max_fine_bricks));
  for (Scratch& s : scratch_)
    for (auto* v : {&s.x, &s.y, &s.z, &s.distance2}) v->resize(kCandidates);
  for (Scratch& s : scratch_) s.chosen.resize(kCandidates + 1);
  view_.brick = brick_.data(), view_.cell = cell_.data();
  clear();
}

std::size_t BrickField::memory_bytes() const {
  const std::size_t words = brick_.size() + cell_.size() + key_.size() + sorted_.size() + of_sparse_.size() + start_.size() + sparse_start_.size() +
                            sparse_count_.size() + occupied_.size() + fine_.size() + x_.size() * 3 + sparse_.x.size() * 6 +
                            std::size(scratch_) * 4 * kCandidates;
  return words * sizeof(float) + sparse_.camera.size() + coarse_.memory_bytes();
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
  pool.run(3, [&](int c) { find_range(axis[c], axis[0], axis[1], axis[2], 0, n, low.data() + c, high.data() + c); });
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
  choose_sparse(pool);
  coarse_.fill(sparse_, pool);
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
  pool.run(kTasks, [&](int task) {
    const Range r = block_range(sum, kTasks, task);
    for (int e = r.begin; e < r.end; ++e) {
      const auto to = static_cast<std::size_t>(e), from = static_cast<std::size_t>(sorted_[to]);
      x_[to] = cloud.x[from], y_[to] = cloud.y[from], z_[to] = cloud.z[from];
    }
  });
}

void BrickField::choose_sparse(WorkerPool& pool) {
  constexpr int kKept = 7, kBlocks = 8;  // of each block of 2 x 2 x 2 cells: the point nearest to its centre, and the outermost along each axis
  const Eigen::Vector3i count = coarse_.cells();
  const float block = view_.cell_size * kBrick / 2;
  pool.run(kTasks, [&](int task) {
    const Range r = block_range(occupied_count_, kTasks, task);
    for (int o = r.begin; o < r.end; ++o) {
      const std::int32_t b = occupied_[static_cast<std::size_t>(o)];
      const float middle[3] = {view_.origin[0] + (2 * static_cast<float>(b % count[0]) + 0.5f) * block,
                               view_.origin[1] + (2 * static_cast<float>(b / count[0] % count[1]) + 0.5f) * block,
                               view_.origin[2] + (2 * static_cast<float>(b / (count[0] * count[1])) + 0.5f) * block};
      float best[kBlocks][kKept];
      std::int32_t which[kBlocks][kKept];
      for (int m = 0; m < kBlocks; ++m)
        for (int k = 0; k < kKept; ++k) best[m][k] = std::numeric_limits<float>::max(), which[m][k] = -1;
      const std::int32_t first = start_[static_cast<std::size_t>(b)], last = start_[static_cast<std::size_t>(b) + 1];
      for (std::int32_t e = first; e < last; ++e) {
        const auto i = static_cast<std::size_t>(e);
        const int c = key_[static_cast<std::size_t>(sorted_[i])], mx = c >> 1 & 1, my = c >> 3 & 1, mz = c >> 5 & 1, m = mx + my * 2 + mz * 4;
        const float dx = x_[i] - (middle[0] + static_cast<float>(mx) * block), dy = y_[i] - (middle[1] + static_cast<float>(my) * block),
                    dz = z_[i] - (middle[2] + static_cast<float>(mz) * block);
        const float cost[kKept] = {dx * dx + dy * dy + dz * dz, dx, -dx, dy, -dy, dz, -dz};
        for (int k = 0; k < kKept; ++k)
          if (cost[k] < best[m][k]) best[m][k] = cost[k], which[m][k] = e;
      }
      std::int32_t chosen = first;
      for (const auto& of_block : which)
        for (int k = 0; k < kKept; ++k)
          if (of_block[k] >= 0 && std::find(of_block, of_block + k, of_block[k]) == of_block + k) of_sparse_[static_cast<std::size_t>(chosen++)] = of_block[k];
      sparse_count_[static_cast<std::size_t>(b)] = chosen - first;
    }
  });
  // One after the other, in the order of the bricks: a row of bricks is one span.
  sparse_.clear();
  int next = 0;
  for (int o = 0; o < occupied_count_; ++o) {
    const std::int32_t b = occupied_[static_cast<std::size_t>(o)], first = start_[static_cast<std::size_t>(b)];
    for (; next <= b; ++next) sparse_start_[static_cast<std::size_t>(next)] = sparse_.size;
    for (std::int32_t e = first; e < first + sparse_count_[static_cast<std::size_t>(b)]; ++e) {
      const auto i = static_cast<std::size_t>(of_sparse_[static_cast<std::size_t>(e)]), to = static_cast<std::size_t>(sparse_.size++);
      sparse_.x[to] = x_[i], sparse_.y[to] = y_[i], sparse_.z[to] = z_[i];
    }
  }
  for (; next <= bricks_; ++next) sparse_start_[static_cast<std::size_t>(next)] = sparse_.size;
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
        cell_[static_cast<std::size_t>(1 + b)] = i < 0 ? kNoPoint : describe_far(corner, i);
      }
  });
}

std::int32_t BrickField::describe_far(const float* corner, std::int32_t guess) const {
  // The coarse grid hands on one point a brick and so misses some by a little: the true one is in the guess's brick or beside it.
  const Eigen::Vector3i count = coarse_.cells();
  const float edge = view_.cell_size * kBrick;
  const float centre[3] = {corner[0] + edge / 2, corner[1] + edge / 2, corner[2] + edge / 2};
  const float* v[3] = {sparse_.x.data(), sparse_.y.data(), sparse_.z.data()};
  int at[3];
  float d2 = 0;
  for (int c = 0; c < 3; ++c) {
    const float p = v[c][guess];
    at[c] = std::clamp(static_cast<int>((p - view_.origin[c]) / edge), 0, count[c] - 1);
    d2 += (p - centre[c]) * (p - centre[c]);
  }
  std::int32_t best = guess;
  const auto gap2 = [&](int c, int i) {  // squared distance along an axis from the centre to a layer of bricks
    const float low = view_.origin[c] + static_cast<float>(i) * edge, d = std::max({low - centre[c], centre[c] - low - edge, 0.0f});
    return d * d;
  };
  const int x0 = std::max(at[0] - 1, 0), x1 = std::min(at[0] + 1, count[0] - 1);
  for (int z = std::max(at[2] - 1, 0); z <= std::min(at[2] + 1, count[2] - 1); ++z)
    for (int y = std::max(at[1] - 1, 0); y <= std::min(at[1] + 1, count[1] - 1); ++y) {
      if (gap2(1, y) + gap2(2, z) >= d2) continue;
      const int row = (z * count[1] + y) * count[0];
      const std::int32_t first = sparse_start_[static_cast<std::size_t>(row + x0)], last = sparse_start_[static_cast<std::size_t>(row + x1 + 1)];
      nearest_of(v[0], v[1], v[2], first, last, centre, &d2, &best);
    }
  return pack(corner, v[0][best], v[1][best], v[2][best]);
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
  const bool is_sparse = distance > kSparse * edge;
  const auto& start = is_sparse ? sparse_start_ : start_;
  const float* v[3] = {is_sparse ? sparse_.x.data() : x_.data(), is_sparse ? sparse_.y.data() : y_.data(), is_sparse ? sparse_.z.data() : z_.data()};
  const float low[3] = {corner[0] + 0.5f * cell, corner[1] + 0.5f * cell, corner[2] + 0.5f * cell};
  const float high[3] = {low[0] + 3 * cell, low[1] + 3 * cell, low[2] + 3 * cell};
  const int layers = 1 + static_cast<int>((reach - 0.5f * cell) / edge);
  const auto gap = [&](int i) { return i == 0 ? 0 : (static_cast<float>(std::abs(i) - 1) * edge + 0.5f * cell); };
  const int x0 = std::max(bx - layers, 0), x1 = std::min(bx + layers, count[0] - 1);
  int candidates = 0;
  for (int z = std::max(bz - layers, 0); z <= std::min(bz + layers, count[2] - 1); ++z)
    for (int y = std::max(by - layers, 0); y <= std::min(by + layers, count[1] - 1); ++y) {
      if (gap(y - by) * gap(y - by) + gap(z - bz) * gap(z - bz) > reach * reach) continue;
      const int row = (z * count[1] + y) * count[0];
      const std::int32_t first = start[static_cast<std::size_t>(row + x0)], last = start[static_cast<std::size_t>(row + x1 + 1)];
      for (std::int32_t from = first; from < last; from += kPart) {
        const int part = std::min(last - from, kPart);
        box_distance2(v[0] + from, v[1] + from, v[2] + from, part, low, high, s.distance2.data());
        if (candidates + part > kCandidates) break;
        for (int i = 0; i < part; ++i) {  // without a branch: every point is written, those that are near enough stay
          s.chosen[static_cast<std::size_t>(candidates)] = from + i;
          candidates += s.distance2[static_cast<std::size_t>(i)] <= reach * reach;
        }
      }
    }
  for (int i = 0; i < candidates; ++i) {
    const auto to = static_cast<std::size_t>(i), k = static_cast<std::size_t>(s.chosen[to]);
    s.x[to] = (v[0][k] - low[0]) * view_.inverse_cell, s.y[to] = (v[1][k] - low[1]) * view_.inverse_cell, s.z[to] = (v[2][k] - low[2]) * view_.inverse_cell;
  }
  std::int32_t best[kBrickCells];
  nearest_of_cells(s.x.data(), s.y.data(), s.z.data(), candidates, best);
  std::int32_t* out = cell_.data() + brick_[static_cast<std::size_t>(brick)];
  // Relative to the brick's corner, in steps.
  const float per_step = 1 / view_.step;
  for (int c = 0; c < kBrickCells; ++c) {
    if (best[c] == kNoCandidate) {
      out[c] = kNoPoint;
      continue;
    }
    const auto k = static_cast<std::size_t>(best[c] & (kCandidates - 1));
    const auto whole = [&](float p) { return static_cast<int>(std::floor((p + 0.5f) * per_step + 0.5f)); };
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

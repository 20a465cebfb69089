// Every point offers itself to the cells around it; what they keep spreads to those further away, row by row, layer by layer, with true distances.
#include "fit/cloud/cell_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "fit/kernel.hpp"
#include "fit/swarm/lanes.hpp"

namespace booth::fit {
namespace {

using cells::kAnyPoint;
using cells::kNoPoint;
using cells::word;

// The view's cells are the fine ones here; 2 x 2 x 2 of them are one of the coarse grid, over which what lies far from the cloud is found. A word's unit is
// the same in both.
constexpr int kSteps = 32, kLayerSteps = 16;  // of a fine cell along x and y, along z
constexpr float kPerCell = 1 << 26;           // what square() takes for one fine cell, before squaring
constexpr float kUsable = 1000;               // m
constexpr int kMost = 512;                    // cells along an axis
constexpr int kChunk = 16;                    // cells along x that are treated together
constexpr int kTasks = 16;
// Cells beyond the band on every side, to the first cell's centre: the two outermost of the coarse grid have no point. A device takes 1.8 bricks to the first
// cell's corner (fit/swarm/device/point_kernels.hpp): two and a half cells more, so that its cells lie as these do and both fields mostly choose alike.
constexpr float kMargin = 4.7f;
constexpr float kMostBand = 27;       // cells, which a word still holds with the way from the band's last cell
constexpr int kReach = 1;             // layers and rows to either side to which a point offers itself
constexpr int kBefore = 3, kRow = 8;  // ... and cells along x: so many before its own, so many in all
constexpr int kIndexBits = 17;
constexpr float kKeyUnits = 990;  // per squared cell: the furthest of those cells still fits 15 bits
constexpr std::uint32_t kNoKey = 0xFFFFFFFF;

/// Squared length of a word, in units of 2^-52 squared cells.
inline __attribute__((always_inline)) float square(std::int32_t w) {
  const float x = static_cast<float>(static_cast<std::int32_t>(static_cast<std::uint32_t>(w) << 21));
  const float y = static_cast<float>(static_cast<std::int32_t>(static_cast<std::uint32_t>(w) << 10)), z = static_cast<float>(w);
  return x * x + y * y + z * z;
}

/// The nearer of a cell's own answer and the one that another cell, `away` from here, offers. Never further than the limit.
inline __attribute__((always_inline)) std::int32_t nearer(std::int32_t own, std::int32_t other, std::int32_t away, float limit2) {
  const std::int32_t offered = static_cast<std::int32_t>(static_cast<std::uint32_t>(other) + static_cast<std::uint32_t>(away));
  const float mine = square(own), theirs = square(offered);
  return theirs < (mine < limit2 ? mine : limit2) ? offered : own;
}

BOOTH_KERNEL void offer_row(std::int32_t* own, const std::int32_t* other, int count, std::int32_t away, float limit2) {
  for (int i = 0; i < count; ++i) own[i] = nearer(own[i], other[i], away, limit2);
}

/// Likewise for chunks of a row that are near in both rows.
BOOTH_KERNEL void offer_chunks(std::int32_t* own, const std::int32_t* other, const std::uint8_t* near_own, const std::uint8_t* near_other, int chunks,
                               std::int32_t away, float limit2) {
  for (int c = 0; c < chunks; ++c) {
    if (!(near_own[c] & near_other[c])) continue;
    for (int i = 0; i < kChunk; ++i) own[c * kChunk + i] = nearer(own[c * kChunk + i], other[c * kChunk + i], away, limit2);
  }
}

/// Offers of the cells `step` to either side; `from` has as many spare words on both sides of the row.
BOOTH_KERNEL void offer_both(std::int32_t* own, const std::int32_t* from, int count, int step, std::int32_t away, float limit2) {
  for (int i = 0; i < count; ++i) {
    const std::int32_t w = nearer(from[i], from[i - step], -away, limit2);
    own[i] = nearer(w, from[i + step], away, limit2);
  }
}

/// Position in cells, and the layer (-1: not usable), of the points [begin, end).
BOOTH_KERNEL void to_cells(const float* x, const float* y, const float* z, int begin, int end, const float* origin, float inverse, float* cx, float* cy,
                           float* cz, std::int16_t* layer) {
  const float ox = origin[0], oy = origin[1], oz = origin[2];
  for (int i = begin; i < end; ++i) {
    const bool good = std::abs(x[i]) < kUsable && std::abs(y[i]) < kUsable && std::abs(z[i]) < kUsable;
    cx[i] = (x[i] - ox) * inverse, cy[i] = (y[i] - oy) * inverse, cz[i] = (z[i] - oz) * inverse;
    layer[i] = static_cast<std::int16_t>(good ? static_cast<std::int32_t>(cz[i] + 0.5f) : -1);
  }
}

/// Least and greatest coordinate among the usable points.
BOOTH_KERNEL void find_range(const float* v, const float* x, const float* y, const float* z, int count, float* low, float* high) {
  constexpr int kLanes = 16;
  float least[kLanes], most[kLanes];
  for (int k = 0; k < kLanes; ++k) least[k] = std::numeric_limits<float>::max(), most[k] = -std::numeric_limits<float>::max();
  int i = 0;
  for (; i + kLanes <= count; i += kLanes)
    for (int k = 0; k < kLanes; ++k) {
      const bool good = std::abs(x[i + k]) < kUsable && std::abs(y[i + k]) < kUsable && std::abs(z[i + k]) < kUsable;
      const float a = good ? v[i + k] : std::numeric_limits<float>::max(), b = good ? v[i + k] : -std::numeric_limits<float>::max();
      least[k] = a < least[k] ? a : least[k], most[k] = b > most[k] ? b : most[k];
    }
  for (; i < count; ++i) {
    const bool good = std::abs(x[i]) < kUsable && std::abs(y[i]) < kUsable && std::abs(z[i]) < kUsable;
    if (good) least[0] = std::min(least[0], v[i]), most[0] = std::max(most[0], v[i]);
  }
  for (int k = 0; k < kLanes; ++k) *low = std::min(*low, least[k]), *high = std::max(*high, most[k]);
}

/// Points [first, last) offer themselves to the cells around them in the layers [low, high]. A cell's key is the squared distance, then the point's
/// index, in one number: the least of two keys is the nearer point's.
BOOTH_KERNEL void offer_points(const float* x, const float* y, const float* z, int first, int last, std::int32_t* cell, int nx, int ny, int low, int high) {
  for (int p = first; p < last; ++p) {
    const int ix = static_cast<int>(x[p] + 0.5f), iy = static_cast<int>(y[p] + 0.5f), iz = static_cast<int>(z[p] + 0.5f), x0 = ix - kBefore;
    std::uint32_t along[kRow];
    const float dx = static_cast<float>(x0) - x[p];
    for (int k = 0; k < kRow; ++k) {
      const float d = dx + static_cast<float>(k);
      along[k] = (static_cast<std::uint32_t>(static_cast<std::int32_t>(d * d * kKeyUnits)) << kIndexBits) | static_cast<std::uint32_t>(p);
    }
    for (int layer = std::max(iz - kReach, low); layer <= std::min(iz + kReach, high); ++layer) {
      const float dz = static_cast<float>(layer) - z[p];
      auto* at = reinterpret_cast<std::uint32_t*>(cell) + (layer * ny + iy - kReach) * nx + x0;
      for (int r = -kReach; r <= kReach; ++r, at += nx) {
        const float dy = static_cast<float>(iy + r) - y[p];
        const std::uint32_t across = static_cast<std::uint32_t>(static_cast<std::int32_t>((dy * dy + dz * dz) * kKeyUnits)) << kIndexBits;
        for (int k = 0; k < kRow; ++k) {
          const std::uint32_t key = along[k] + across;
          at[k] = key < at[k] ? key : at[k];
        }
      }
    }
  }
}

/// Keys become words: point's less cell's.
BOOTH_KERNEL void keys_to_words(std::int32_t* cell, int count, const std::int32_t* point, std::int32_t first) {
  for (int i = 0; i < count; ++i) {
    const std::uint32_t key = static_cast<std::uint32_t>(cell[i]);
    const bool none = key == kNoKey;
    const std::uint32_t at = none ? 0 : key & ((1u << kIndexBits) - 1);
    const std::uint32_t w = static_cast<std::uint32_t>(point[at]) - (static_cast<std::uint32_t>(first) + static_cast<std::uint32_t>(i * kSteps));
    cell[i] = none ? kNoPoint : static_cast<std::int32_t>(w);
  }
}

/// From a cell to the middle of the 2 x 2 x 2 that it is (x, y, z)-th of, as a word.
constexpr std::int32_t to_middle(int x, int y, int z) { return word((2 * x - 1) * (kSteps / 2), (2 * y - 1) * (kSteps / 2), (2 * z - 1) * (kLayerSteps / 2)); }

/// Two neighbouring cells of a row, one of four rows, offer what they have to their middle.
BOOTH_KERNEL void offer_to_middle(std::int32_t* middle, const std::int32_t* fine, int count, int y, int z, float limit2) {
  const std::int32_t left = to_middle(0, y, z), right = to_middle(1, y, z);
  for (int i = 0; i < count; ++i) middle[i] = nearer(nearer(middle[i], fine[2 * i], left, limit2), fine[2 * i + 1], right, limit2);
}

/// A word as another cell sees it, `away` from here.
inline __attribute__((always_inline)) std::int32_t seen_from(std::int32_t w, std::int32_t away) {
  const auto seen = static_cast<std::int32_t>(static_cast<std::uint32_t>(w) - static_cast<std::uint32_t>(away));
  return w < kAnyPoint ? kNoPoint : seen;
}

/// The two neighbouring cells of a row take what their middle has, or its want of a point ...
BOOTH_KERNEL void take_from_middle(std::int32_t* fine, const std::int32_t* middle, int count, int y, int z) {
  const std::int32_t left = to_middle(0, y, z), right = to_middle(1, y, z);
  for (int i = 0; i < count; ++i) fine[2 * i] = seen_from(middle[i], left), fine[2 * i + 1] = seen_from(middle[i], right);
}

/// ... or keep their own where that is nearer.
BOOTH_KERNEL void take_if_nearer(std::int32_t* fine, const std::int32_t* middle, int count, int y, int z, float limit2) {
  const std::int32_t left = to_middle(0, y, z), right = to_middle(1, y, z);
  for (int i = 0; i < count; ++i) {
    fine[2 * i] = nearer(fine[2 * i], middle[i], -left, limit2);
    fine[2 * i + 1] = nearer(fine[2 * i + 1], middle[i], -right, limit2);
  }
}

void check(const FieldSettings& s) {
  const auto need = [](bool good, const char* what) {
    if (!good) throw std::invalid_argument(std::string("nearest-point field: ") + what);
  };
  need(s.cell >= 0.002f && s.cell <= 0.25f, "cell must be 0.002 to 0.25 m");
  need(s.band > 0 && s.band <= kMostBand * s.cell, "band must be above 0 and at most 27 cells");
  need(s.fine >= 0 && s.fine <= s.band, "fine must be 0 to the band");
  need(s.max_points >= 1 && s.max_points <= 1 << kIndexBits, "max_points must be 1 to 131072");
  need(s.max_bricks >= 4096 && s.max_bricks <= 1 << 18, "max_bricks must be 4096 to 262144");
}

}  // namespace

CellField::CellField(const FieldSettings& settings) : settings_((check(settings), settings)) {
  const auto bricks = static_cast<std::size_t>(settings.max_bricks), points = static_cast<std::size_t>(settings.max_points);
  fine_.assign(bricks * 64, kNoPoint);
  coarse_.assign(bricks * 8, kNoPoint);
  occupied_.resize(bricks), near_.resize(bricks / 4 + 1);
  for (auto* v : {&x_, &y_, &z_, &sorted_x_, &sorted_y_, &sorted_z_}) v->resize(points);
  word_.resize(points), layer_.resize(points);
  start_.resize(kMost + 1), next_.resize(kTasks * kMost);
  clear();
}

std::size_t CellField::memory_bytes() const {
  return (fine_.size() + coarse_.size() + x_.size() * 6 + word_.size() + start_.size() + next_.size()) * sizeof(std::int32_t) +
         layer_.size() * sizeof(std::int16_t) + occupied_.size() + near_.size();
}

void CellField::clear() {
  nx_ = ny_ = nz_ = 2;
  std::fill_n(fine_.begin(), cells(), kNoPoint);
  view_.middle = fine_.data();
  view_.stride_y = view_.stride_z = 0;
  for (float& r : view_.reach) r = 0;
}

void CellField::set_box(const float* low, const float* high) {
  float size = settings_.cell;
  for (;; size *= 1.1f) {
    const float extra = 2 * (settings_.band / size + kMargin) + 1;
    const auto along = [&](int c, int whole) {
      const float cells = (high[c] - low[c]) / size + extra;
      return cells < kMost ? (static_cast<int>(cells) / whole + 1) * whole : kMost + 1;
    };
    nx_ = along(0, kChunk), ny_ = along(1, 4), nz_ = along(2, 4);
    if (nx_ <= kMost && ny_ <= kMost && nz_ <= kMost && static_cast<std::int64_t>(nx_) * ny_ * nz_ <= static_cast<std::int64_t>(settings_.max_bricks) * 64)
      break;
  }
  inverse_ = 1 / size;
  view_.cell_size = size, view_.inverse_cell = inverse_;
  const int count[3] = {nx_, ny_, nz_};
  for (int c = 0; c < 3; ++c) {
    origin_[c] = low[c] - (settings_.band + kMargin * size);
    const int middle = count[c] / 2;
    view_.origin[c] = origin_[c] + static_cast<float>(middle) * size;
    view_.reach[c] = static_cast<float>(middle - 1);
  }
  view_.middle = row(ny_ / 2, nz_ / 2) + nx_ / 2;
  view_.stride_y = static_cast<float>(nx_), view_.stride_z = static_cast<float>(nx_ * ny_);
  // Half the diagonal of 2 x 2 x 2 cells more than the band: whoever asks within the band gets an answer.
  const float limit = (settings_.band / size + 1.75f) * kPerCell;
  limit2_ = limit * limit;
}

void CellField::rebuild(const Cloud& cloud, WorkerPool& pool) {
  const int n = std::min(cloud.size, settings_.max_points);
  clear();
  float low[3], high[3];
  for (int c = 0; c < 3; ++c) low[c] = std::numeric_limits<float>::max(), high[c] = -low[c];
  const float* axis[3] = {cloud.x.data(), cloud.y.data(), cloud.z.data()};
  pool.run(3, [&](int c) { find_range(axis[c], axis[0], axis[1], axis[2], n, low + c, high + c); });
  if (!(low[0] <= high[0])) return;
  set_box(low, high);
  sort_points(cloud, n, pool);
  pool.run(nz_ / 4, [&](int z) { mark_occupied(z); });
  pool.run(nz_ / 4, [&](int z) { describe_layers(z); });
  pool.run(ny_ / 4, [&](int y) { spread_across_layers(y); });
  pool.run(nz_ / 2, [&](int z) { describe_coarse_layer(z); });
  pool.run(ny_ / 2, [&](int y) { spread_across_coarse_layers(y); });
  pool.run(nz_ / 2, [&](int z) { write_cells(z); });
}

void CellField::sort_points(const Cloud& cloud, int n, WorkerPool& pool) {
  // Each task counts its points by layers, then knows where they go: behind those of the layers below and those of its own layer that come before them.
  pool.run(kTasks, [&](int task) {
    const Range r = block_range(n, kTasks, task);
    to_cells(cloud.x.data(), cloud.y.data(), cloud.z.data(), r.begin, r.end, origin_, inverse_, x_.data(), y_.data(), z_.data(), layer_.data());
    std::int32_t* next = next_.data() + task * kMost;
    std::fill_n(next, nz_, 0);
    for (int i = r.begin; i < r.end; ++i)
      if (const int layer = layer_[static_cast<std::size_t>(i)]; layer >= 0) ++next[layer];
  });
  std::int32_t sum = 0;
  for (int z = 0; z < nz_; ++z) {
    start_[static_cast<std::size_t>(z)] = sum;
    for (int task = 0; task < kTasks; ++task) {
      std::int32_t& next = next_[static_cast<std::size_t>(task * kMost + z)];
      const std::int32_t count = next;
      next = sum, sum += count;
    }
  }
  start_[static_cast<std::size_t>(nz_)] = sum;
  pool.run(kTasks, [&](int task) {
    const Range r = block_range(n, kTasks, task);
    std::int32_t* next = next_.data() + task * kMost;
    for (int i = r.begin; i < r.end; ++i) {
      const auto from = static_cast<std::size_t>(i);
      if (layer_[from] < 0) continue;
      const auto to = static_cast<std::size_t>(next[layer_[from]]++);
      sorted_x_[to] = x_[from], sorted_y_[to] = y_[from], sorted_z_[to] = z_[from];
    }
  });
}

void CellField::mark_occupied(int brick_z) {
  std::uint8_t* flags = occupied_.data() + brick_z * (ny_ / 4) * (nx_ / 4);
  std::fill_n(flags, (ny_ / 4) * (nx_ / 4), std::uint8_t{0});
  const auto first = static_cast<std::size_t>(start_[static_cast<std::size_t>(4 * brick_z)]);
  const auto last = static_cast<std::size_t>(start_[static_cast<std::size_t>(4 * brick_z + 4)]);
  for (std::size_t i = first; i < last; ++i) {
    const auto whole = [](float v, float steps) { return static_cast<int>(v * steps + 0.5f); };
    flags[(whole(sorted_y_[i], 1) >> 2) * (nx_ / 4) + (whole(sorted_x_[i], 1) >> 2)] = 1;
    word_[i] = word(whole(sorted_x_[i], kSteps), whole(sorted_y_[i], kSteps), whole(sorted_z_[i], kLayerSteps));
  }
}

void CellField::mark_near(int brick_y, int brick_z) {
  const int bricks_x = nx_ / 4, bricks_y = ny_ / 4, bricks_z = nz_ / 4;
  std::uint8_t around[kMost / 4 + 8] = {};  // of a column of 3 x 3 bricks about the row; four spare ones on both sides
  for (int z = std::max(brick_z - 1, 0); z <= std::min(brick_z + 1, bricks_z - 1); ++z)
    for (int y = std::max(brick_y - 1, 0); y <= std::min(brick_y + 1, bricks_y - 1); ++y) {
      const std::uint8_t* flags = occupied_.data() + (z * bricks_y + y) * bricks_x;
      for (int x = 0; x < bricks_x; ++x) around[4 + x] |= flags[x];
    }
  std::uint8_t* near = chunks(near_, 4 * brick_y, 4 * brick_z);
  for (int c = 0; c < nx_ / kChunk; ++c) {
    const std::uint8_t* a = around + 4 + 4 * c;
    near[c] = a[-1] | a[0] | a[1] | a[2] | a[3] | a[4];
  }
}

void CellField::describe_layers(int brick_z) {
  const int chunk_count = nx_ / kChunk;
  bool any = false;
  for (int y = 0; y < ny_; y += 4) {
    mark_near(y / 4, brick_z);
    const std::uint8_t* near = chunks(near_, y, 4 * brick_z);
    for (int c = 0; c < chunk_count; ++c) {
      if (!near[c]) continue;
      any = true;
      for (int k = 0; k < 16; ++k) std::fill_n(row(y + k % 4, 4 * brick_z + k / 4) + c * kChunk, kChunk, static_cast<std::int32_t>(kNoKey));
    }
  }
  if (!any) return;
  const int low = 4 * brick_z, high = low + 3;
  offer_points(sorted_x_.data(), sorted_y_.data(), sorted_z_.data(), start_[static_cast<std::size_t>(std::max(low - kReach, 0))],
               start_[static_cast<std::size_t>(std::min(high + kReach + 1, nz_))], fine_.data(), nx_, ny_, low, high);
  for (int z = low; z <= high; ++z) describe_layer(z);
}

void CellField::describe_layer(int z) {
  const int chunk_count = nx_ / kChunk;
  for (int y = 0; y < ny_; ++y) {
    const std::uint8_t* near = chunks(near_, y, z);
    for (int c = 0; c < chunk_count; ++c)
      if (near[c]) keys_to_words(row(y, z) + c * kChunk, kChunk, word_.data(), word(c * kChunk * kSteps, y * kSteps, z * kLayerSteps));
  }
  for (int y = 1; y < ny_; ++y) offer_chunks(row(y, z), row(y - 1, z), chunks(near_, y, z), chunks(near_, y - 1, z), chunk_count, word(0, -kSteps, 0), limit2_);
  for (int y = ny_ - 2; y >= 0; --y)
    offer_chunks(row(y, z), row(y + 1, z), chunks(near_, y, z), chunks(near_, y + 1, z), chunk_count, word(0, kSteps, 0), limit2_);
}

void CellField::spread_across_layers(int brick_y) {
  const int chunk_count = nx_ / kChunk;
  const auto take = [&](int y, int to, int from, std::int32_t away) {
    offer_chunks(row(y, to), row(y, from), chunks(near_, y, to), chunks(near_, y, from), chunk_count, away, limit2_);
  };
  for (int z = 1; z < nz_; ++z)
    for (int y = 4 * brick_y; y < 4 * brick_y + 4; ++y) take(y, z, z - 1, word(0, 0, -kLayerSteps));
  for (int z = nz_ - 2; z >= 0; --z)
    for (int y = 4 * brick_y; y < 4 * brick_y + 4; ++y) take(y, z, z + 1, word(0, 0, kLayerSteps));
}

void CellField::describe_coarse_layer(int z) {
  const int width = nx_ / 2, height = ny_ / 2;
  bool any_row = false;
  for (int y = 0; y < height; ++y) {
    std::int32_t* own = coarse_row(y, z);
    const std::uint8_t* near = chunks(near_, 2 * y, 2 * z);
    std::fill_n(own, width, kNoPoint);
    bool any = false;
    for (int c = 0; c < nx_ / kChunk; ++c) {
      if (!near[c]) continue;
      any = true;
      for (int k = 0; k < 4; ++k)
        offer_to_middle(own + c * kChunk / 2, row(2 * y + (k & 1), 2 * z + (k >> 1)) + c * kChunk, kChunk / 2, k & 1, k >> 1, limit2_);
    }
    if (!any) continue;
    any_row = true;
    std::int32_t copy[3 * kChunk + kMost / 2];
    std::fill_n(copy, width + 2 * kChunk, kNoPoint);
    for (int step : {1, 8, 4, 2, 1}) {
      std::copy_n(own, width, copy + kChunk);
      offer_both(own, copy + kChunk, width, step, word(2 * step * kSteps, 0, 0), limit2_);
    }
  }
  if (any_row) spread_in_coarse_layer(z);
}

void CellField::spread_across_coarse_layers(int y) {
  const int width = nx_ / 2, depth = nz_ / 2;
  for (int z = 1; z < depth; ++z) offer_row(coarse_row(y, z), coarse_row(y, z - 1), width, word(0, 0, -2 * kLayerSteps), limit2_);
  for (int z = depth - 2; z >= 0; --z) offer_row(coarse_row(y, z), coarse_row(y, z + 1), width, word(0, 0, 2 * kLayerSteps), limit2_);
}

void CellField::spread_in_coarse_layer(int z) {
  const int width = nx_ / 2, height = ny_ / 2;
  for (int y = 1; y < height; ++y) offer_row(coarse_row(y, z), coarse_row(y - 1, z), width, word(0, -2 * kSteps, 0), limit2_);
  for (int y = height - 2; y >= 0; --y) offer_row(coarse_row(y, z), coarse_row(y + 1, z), width, word(0, 2 * kSteps, 0), limit2_);
}

void CellField::write_cells(int z) {
  spread_in_coarse_layer(z);  // once more: what came from other layers spreads in this one
  for (int fine_z = 2 * z; fine_z < 2 * z + 2; ++fine_z)
    for (int y = 0; y < ny_; ++y) {
      const std::uint8_t* near = chunks(near_, y, fine_z);
      for (int c = 0, end; c < nx_ / kChunk; c = end) {  // runs of chunks
        for (end = c + 1; end < nx_ / kChunk && (near[end] != 0) == (near[c] != 0); ++end) {
        }
        std::int32_t* fine = row(y, fine_z) + c * kChunk;
        const std::int32_t* middle = coarse_row(y / 2, z) + c * kChunk / 2;
        const int count = (end - c) * kChunk / 2;
        if (near[c])
          take_if_nearer(fine, middle, count, y & 1, fine_z & 1, limit2_);
        else
          take_from_middle(fine, middle, count, y & 1, fine_z & 1);
      }
    }
}

bool CellField::nearest(const Eigen::Vector3f& p, Eigen::Vector3f& out) const {
  const CellView& f = view_;
  Eigen::Vector3f d;
  for (int c = 0; c < 3; ++c) d[c] = (p[c] - f.origin[c]) * f.inverse_cell;
  if (field_difference<ScalarLanes>(f, d[0], d[1], d[2])) return false;
  out = p - d * f.cell_size;
  return true;
}

}  // namespace booth::fit

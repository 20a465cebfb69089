// The field's memory on a device, and the first half of its build: the cloud's box and bricks, the points sorted by brick.
#pragma once

#include <math.h>

#include <cstdint>

#include "fit/gpu/host_device.hpp"
#include "fit/gpu/launch.hpp"
#include "fit/swarm/device/brick_view.hpp"
#include "fit/swarm/lanes.hpp"

namespace booth::fit::device {

using gpu::Lane;
using gpu::OneRound;

struct alignas(16) Point {
  float x, y, z;
  std::int32_t index;  ///< in the cloud: where two points are equally near, the lower index wins, so that the order of threads does not matter
};

/// The cloud as the host hands it over; pinned. The points stand beside it: x of all, then y, then z, `FieldMemory::capacity` floats each.
struct FieldInput {
  std::int32_t points = 0;
};

/// The frame's box and bricks, found on the device.
struct FieldFrame {
  std::int32_t points = 0;
  std::int32_t bricks[3] = {1, 1, 1};
  float origin[3] = {0, 0, 0};  ///< m
  float edge = 1;               ///< of a brick, m
  float fine = 0, band = 0;     ///< m
  float step = 1;               ///< of offsets, cells
  BOOTH_HOST_DEVICE std::int32_t total() const { return bricks[0] * bricks[1] * bricks[2]; }
};

/// Device memory of the field, and what never changes.
struct FieldMemory {
  const FieldInput* input;  ///< pinned
  const float* cloud;       ///< pinned
  std::int32_t capacity, max_bricks;
  float edge, fine, band;  ///< m; the brick's edge before it grows
  FieldFrame* frame;
  BrickView* view;
  std::int32_t* box;         ///< least x, y, z, then greatest: floats as ordered(); empty between two frames
  std::int32_t* count;       ///< per brick
  std::int32_t* start;       ///< per brick, and one more after each row of bricks: row r's begin at r (bricks[0] + 1)
  std::int8_t* across;       ///< per brick: along x to the nearest brick that has points, or kNoneAcross
  std::int32_t* used;        ///< places given to rows so far
  std::int32_t *key, *rank;  ///< per point: its brick's place in `start` (-1: it cannot be used), and how many of the brick's points came before it
  Point *given, *sorted;
  Point* nearest;              ///< per brick with cells: the point nearest to its centre
  std::int32_t* fine_list;     ///< the bricks with cells, in any order ...
  std::int32_t* fine_count;    ///< ... and how many there are
  std::int32_t *brick, *cell;  ///< brick b answers with cell 1 + b, or with the 64 from 1 + max_bricks + 64 b on; cell 0 has no point
};

/// What was there before.
BOOTH_HOST_DEVICE std::int32_t add(std::int32_t* at, std::int32_t value) {
#if defined(__CUDA_ARCH__)
  return atomicAdd(at, value);
#else
  const std::int32_t before = *at;
  *at += value;
  return before;
#endif
}
BOOTH_HOST_DEVICE void lower(std::int32_t* at, std::int32_t value) {
#if defined(__CUDA_ARCH__)
  atomicMin(at, value);
#else
  if (value < *at) *at = value;
#endif
}
BOOTH_HOST_DEVICE void raise(std::int32_t* at, std::int32_t value) {
#if defined(__CUDA_ARCH__)
  atomicMax(at, value);
#else
  if (value > *at) *at = value;
#endif
}

/// Integers that compare as the floats do, and back.
BOOTH_HOST_DEVICE std::int32_t ordered(float x) {
  const std::int32_t i = ScalarLanes::as_int(x);
  return i ^ ((i >> 31) & 0x7fffffff);
}
BOOTH_HOST_DEVICE float unordered(std::int32_t i) { return ScalarLanes::as_float(i ^ ((i >> 31) & 0x7fffffff)); }

inline constexpr float kUsable = 1000;  ///< m
inline constexpr std::int8_t kNoneAcross = 127;
inline constexpr int kMostBricksInLayer = 32767;  ///< as BrickView packs it
inline constexpr std::int32_t kEmptyLow = 0x7fffffff, kEmptyHigh = -0x7fffffff - 1;

BOOTH_HOST_DEVICE bool usable(float x, float y, float z) { return fabsf(x) < kUsable && fabsf(y) < kUsable && fabsf(z) < kUsable; }

/// Box and bricks of a cloud; points = 0 where there is nothing to look at.
BOOTH_HOST_DEVICE FieldFrame field_frame(const FieldMemory& m) {
  FieldFrame f;
  f.fine = m.fine, f.band = m.band, f.edge = m.edge;
  const bool empty = m.box[0] > m.box[3];
  while (!empty) {
    const float margin = m.band + 1.8f * f.edge;
    double total = 1;
    for (int c = 0; c < 3; ++c) {
      const float low = unordered(m.box[c]), high = unordered(m.box[3 + c]);
      f.origin[c] = low - margin;
      f.bricks[c] = static_cast<std::int32_t>((high - low + 2 * margin) / f.edge) + 1;
      total *= f.bricks[c];
    }
    if (total <= m.max_bricks && static_cast<double>(f.bricks[0]) * f.bricks[1] <= kMostBricksInLayer) break;
    f.edge *= 1.1f;
  }
  f.points = empty ? 0 : m.input->points;
  f.step = (m.band + 2 * f.edge) / (f.edge / kBrick) / kOffsetLimit;
  return f;
}

/// What crosses the bus at once.
struct alignas(16) Words {
  std::uint32_t word[4];
};

/// Reads the cloud over the bus, once, and finds its box; and, for the swarm that follows, its frame. Bricks have no points yet.
struct TakeCloud : OneRound {
  static constexpr int kThreads = 256, kPhases = 3, kWarp = 32;
  struct Shared {
    float low[3][kThreads], high[3][kThreads];
  };
  struct Private {};
  explicit TakeCloud(const FieldMemory& memory, const Words* from = nullptr, Words* to = nullptr, int words = 0)
      : m(memory), frame_from(from), frame_to(to), frame_words(words) {}
  FieldMemory m;
  const Words* frame_from;
  Words* frame_to;
  std::int32_t frame_words;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int, Shared& s, Private&) const {
    const int t = lane.thread;
    if constexpr (kPhase == 0) {
      const std::int32_t first = lane.block * kThreads + t, stride = lane.blocks * kThreads, n = m.input->points;
      float low[3] = {kUsable, kUsable, kUsable}, high[3] = {-kUsable, -kUsable, -kUsable};
      for (std::int32_t i = first; i < n; i += stride) {
        const float p[3] = {m.cloud[i], m.cloud[m.capacity + i], m.cloud[2 * m.capacity + i]};
        m.given[i] = {p[0], p[1], p[2], i};
        if (!usable(p[0], p[1], p[2])) continue;
        for (int c = 0; c < 3; ++c) low[c] = p[c] < low[c] ? p[c] : low[c], high[c] = p[c] > high[c] ? p[c] : high[c];
      }
      // By the last threads, which have the fewest points.
      for (std::int32_t i = stride - 1 - first; i < frame_words; i += stride) frame_to[i] = frame_from[i];
      for (int c = 0; c < 3; ++c) s.low[c][t] = low[c], s.high[c][t] = high[c];
      for (std::int32_t b = first; b < m.max_bricks; b += stride) m.count[b] = 0;
      if (first == 0) *m.used = *m.fine_count = 0, m.cell[0] = kNoPoint;
    } else if constexpr (kPhase == 1) {
      if (t >= kWarp) return;
      for (int i = t; i < kThreads; i += kWarp)
        for (int c = 0; c < 3; ++c) {
          s.low[c][t] = s.low[c][i] < s.low[c][t] ? s.low[c][i] : s.low[c][t];
          s.high[c][t] = s.high[c][i] > s.high[c][t] ? s.high[c][i] : s.high[c][t];
        }
    } else {
      if (t >= 3) return;
      float low = s.low[t][0], high = s.high[t][0];
      for (int i = 1; i < kWarp; ++i) low = s.low[t][i] < low ? s.low[t][i] : low, high = s.high[t][i] > high ? s.high[t][i] : high;
      if (low > high) return;  // none of the block's points can be used
      lower(m.box + t, ordered(low)), raise(m.box + 3 + t, ordered(high));
    }
  }
};

/// Counts each brick's points; the count that a point finds is its rank there. What the frame's bricks are, every block finds for itself.
struct CountPoints : OneRound {
  static constexpr int kThreads = 256, kPhases = 2;
  struct Shared {
    FieldFrame frame;
  };
  struct Private {};
  explicit CountPoints(const FieldMemory& memory) : m(memory) {}
  FieldMemory m;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int, Shared& s, Private&) const {
    if constexpr (kPhase == 0) {
      if (lane.thread != 0) return;
      const FieldFrame f = field_frame(m);
      s.frame = f;
      if (lane.block != 0) return;
      *m.frame = f;
      BrickView& v = *m.view;
      v.brick = m.brick, v.cell = m.cell;
      v.cell_size = f.edge / kBrick, v.inverse_cell = 1 / v.cell_size;
      for (int c = 0; c < 3; ++c) v.origin[c] = f.origin[c], v.last[c] = f.points > 0 ? static_cast<float>(f.bricks[c] * kBrick) - 0.5f : 0.0f;
      v.brick_strides = f.bricks[0] | (f.bricks[0] * f.bricks[1]) << 16;
      v.step = f.step;
    } else {
      const FieldFrame f = s.frame;
      for (std::int32_t i = lane.block * kThreads + lane.thread; i < f.points; i += lane.blocks * kThreads) {
        const Point p = m.given[i];
        const float place[3] = {p.x, p.y, p.z};
        const bool good = usable(p.x, p.y, p.z);
        std::int32_t at[3] = {0, 0, 0};
        for (int c = 0; c < 3 && good; ++c) {
          at[c] = static_cast<std::int32_t>((place[c] - f.origin[c]) / f.edge);
          at[c] = at[c] < 0 ? 0 : at[c] > f.bricks[c] - 1 ? f.bricks[c] - 1 : at[c];
        }
        const std::int32_t row = at[2] * f.bricks[1] + at[1], brick = row * f.bricks[0] + at[0];
        m.key[i] = good ? brick + row : -1;
        if (good) m.rank[i] = add(m.count + brick, 1);
      }
    }
  }
};

/// Where each brick's points begin, and how far it is along x to the next brick that has some. A row of bricks along x takes its place when it comes;
/// which one is left to chance, too.
struct StartRows : OneRound {
  static constexpr int kThreads = 32, kPhases = 1;
  struct Shared {};
  struct Private {};
  explicit StartRows(const FieldMemory& memory) : m(memory) {}
  FieldMemory m;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int, Shared&, Private&) const {
    const FieldFrame& f = *m.frame;
    const std::int32_t nx = f.bricks[0], rows = f.bricks[1] * f.bricks[2];
    if (lane.block == 0 && lane.thread < 6) m.box[lane.thread] = lane.thread < 3 ? kEmptyLow : kEmptyHigh;  // for the next frame
    for (std::int32_t row = lane.block * kThreads + lane.thread; row < rows; row += lane.blocks * kThreads) {
      const std::int32_t* count = m.count + row * nx;
      std::int32_t sum = 0;
      for (std::int32_t x = 0; x < nx; ++x) sum += count[x];
      std::int32_t* start = m.start + row * (nx + 1);
      std::int8_t* across = m.across + row * nx;
      if (sum == 0) {
        for (std::int32_t x = 0; x < nx; ++x) across[x] = kNoneAcross;
        start[0] = start[nx] = 0;  // nobody asks such a row for more
        continue;
      }
      std::int32_t at = add(m.used, sum), gap = kNoneAcross;
      for (std::int32_t x = 0; x < nx; ++x) {
        const std::int32_t n = count[x];
        start[x] = at;
        at += n;
        gap = n > 0 ? 0 : gap < kNoneAcross ? gap + 1 : gap;
        across[x] = static_cast<std::int8_t>(-gap);
      }
      start[nx] = at;
      gap = kNoneAcross;
      for (std::int32_t x = nx - 1; x >= 0; --x) {
        gap = count[x] > 0 ? 0 : gap < kNoneAcross ? gap + 1 : gap;
        if (gap < -across[x] || across[x] == -kNoneAcross) across[x] = static_cast<std::int8_t>(gap);
      }
    }
  }
};

/// The points by brick. Within a brick they stand in the order in which they were counted, which is left to chance; whoever reads them chooses by distance and
/// index.
struct SortPoints : OneRound {
  static constexpr int kThreads = 256, kPhases = 1;
  struct Shared {};
  struct Private {};
  explicit SortPoints(const FieldMemory& memory) : m(memory) {}
  FieldMemory m;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int, Shared&, Private&) const {
    const std::int32_t n = m.frame->points;
    for (std::int32_t i = lane.block * kThreads + lane.thread; i < n; i += lane.blocks * kThreads)
      if (const std::int32_t key = m.key[i]; key >= 0) m.sorted[m.start[key] + m.rank[i]] = m.given[i];
  }
};

}  // namespace booth::fit::device

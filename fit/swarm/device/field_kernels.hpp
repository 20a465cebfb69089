// Builds the nearest-point field (fit/cloud/field_view.hpp) on a device: points sorted by brick, then exact searches that every brick and cell does by itself.
#pragma once

#include <math.h>

#include <cstdint>

#include "fit/cloud/field_view.hpp"
#include "fit/host_device.hpp"
#include "fit/swarm/device/launch.hpp"

namespace booth::fit::device {

struct Point {
  float x, y, z;
  std::int32_t index;  ///< in the cloud: where two points are equally near, the lower index wins, so that the order of threads does not matter
};

/// What changes from frame to frame; uploaded with the cloud.
struct FieldFrame {
  std::int32_t points = 0;
  std::int32_t bricks[3] = {1, 1, 1};
  float origin[3] = {0, 0, 0};  ///< m
  float edge = 1;               ///< of a brick, m
  float fine = 0, band = 0;     ///< m
  float step = 1;               ///< of offsets, cells
  BOOTH_HOST_DEVICE std::int32_t total() const { return bricks[0] * bricks[1] * bricks[2]; }
};

/// Device memory of the field.
struct FieldMemory {
  const FieldFrame* frame;  ///< pinned
  const float* cloud;       ///< pinned: x of all points, then y, then z, `capacity` floats each
  std::int32_t capacity, max_bricks;
  FieldFrame* local_frame;  ///< the device's own copy
  FieldView* view;
  std::int32_t *count, *next;  ///< per brick
  std::int32_t* start;         ///< per brick, and one more after each row of bricks: row r's begin at r (bricks[0] + 1)
  std::int32_t* used;          ///< places given to rows so far
  std::int32_t* key;           ///< per point
  Point *given, *sorted;
  float* distance;             ///< per brick: of the centre from the nearest point
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

inline constexpr float kUsable = 1000;  ///< m

/// Nobody's points yet.
struct ClearField : OneRound {
  static constexpr int kThreads = 256, kPhases = 1;
  struct Shared {};
  struct Private {};
  explicit ClearField(const FieldMemory& memory) : m(memory) {}
  FieldMemory m;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int, Shared&, Private&) const {
    const int first = lane.block * kThreads + lane.thread;
    for (int b = first; b < m.max_bricks;  // all there are: asking the host how many matter would take longer
         b += lane.blocks * kThreads)
      m.count[b] = 0;
    if (first != 0) return;
    const FieldFrame f = *m.frame;
    *m.local_frame = f;
    FieldView& v = *m.view;
    v.brick = m.brick, v.cell = m.cell;
    v.cell_size = f.edge / kBrick, v.inverse_cell = 1 / v.cell_size;
    for (int c = 0; c < 3; ++c) v.origin[c] = f.origin[c], v.last[c] = f.points > 0 ? static_cast<float>(f.bricks[c] * kBrick) - 0.5f : 0.0f;
    v.brick_strides = f.bricks[0] | (f.bricks[0] * f.bricks[1]) << 16;
    v.step = f.step;
    m.cell[0] = kNoPoint;
    *m.used = 0;
  }
};

/// Reads the cloud over the bus, once, and counts each brick's points.
struct CountPoints : OneRound {
  static constexpr int kThreads = 256, kPhases = 1;
  struct Shared {};
  struct Private {};
  explicit CountPoints(const FieldMemory& memory) : m(memory) {}
  FieldMemory m;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int, Shared&, Private&) const {
    const FieldFrame& f = *m.local_frame;
    for (int i = lane.block * kThreads + lane.thread; i < f.points; i += lane.blocks * kThreads) {
      const float p[3] = {m.cloud[i], m.cloud[m.capacity + i], m.cloud[2 * m.capacity + i]};
      const bool good = fabsf(p[0]) < kUsable && fabsf(p[1]) < kUsable && fabsf(p[2]) < kUsable;
      std::int32_t at[3] = {0, 0, 0};
      for (int c = 0; c < 3 && good; ++c) {
        at[c] = static_cast<std::int32_t>((p[c] - f.origin[c]) / f.edge);
        at[c] = at[c] < 0 ? 0 : at[c] > f.bricks[c] - 1 ? f.bricks[c] - 1 : at[c];
      }
      const std::int32_t key = good ? (at[2] * f.bricks[1] + at[1]) * f.bricks[0] + at[0] : -1;
      m.key[i] = key;
      m.given[i] = {p[0], p[1], p[2], i};
      if (good) add(m.count + key, 1);
    }
  }
};

/// Where each brick's points begin. A row of bricks along x takes its place when it comes; which one is left to chance, too.
struct StartRows : OneRound {
  static constexpr int kThreads = 32, kPhases = 1;
  struct Shared {};
  struct Private {};
  explicit StartRows(const FieldMemory& memory) : m(memory) {}
  FieldMemory m;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int, Shared&, Private&) const {
    const FieldFrame& f = *m.local_frame;
    const std::int32_t nx = f.bricks[0], rows = f.bricks[1] * f.bricks[2];
    for (std::int32_t row = lane.block * kThreads + lane.thread; row < rows; row += lane.blocks * kThreads) {
      std::int32_t sum = 0;
      for (std::int32_t x = 0; x < nx; ++x) sum += m.count[row * nx + x];
      std::int32_t at = sum > 0 ? add(m.used, sum) : 0;
      std::int32_t* start = m.start + row * (nx + 1);
      for (std::int32_t x = 0; x < nx; ++x) {
        start[x] = m.next[row * nx + x] = at;
        at += m.count[row * nx + x];
      }
      start[nx] = at;
    }
  }
};

/// The points by brick. Within a brick their order is left to chance; whoever reads them chooses by distance and index.
struct SortPoints : OneRound {
  static constexpr int kThreads = 256, kPhases = 1;
  struct Shared {};
  struct Private {};
  explicit SortPoints(const FieldMemory& memory) : m(memory) {}
  FieldMemory m;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int, Shared&, Private&) const {
    const FieldFrame& f = *m.local_frame;
    for (int i = lane.block * kThreads + lane.thread; i < f.points; i += lane.blocks * kThreads)
      if (const std::int32_t key = m.key[i]; key >= 0) m.sorted[add(m.next + key, 1)] = m.given[i];
  }
};

inline constexpr std::int32_t kNobody = 0x7fffffff;  ///< index of no point

/// The nearest point so far.
struct Nearest {
  float distance2;
  std::int32_t index;
  float x, y, z;

  BOOTH_HOST_DEVICE void offer(const Point& p, float cx, float cy, float cz) {
    const float dx = p.x - cx, dy = p.y - cy, dz = p.z - cz, d = dx * dx + dy * dy + dz * dz;
    if (d < distance2 || (d == distance2 && p.index < index)) distance2 = d, index = p.index, x = p.x, y = p.y, z = p.z;
  }
  BOOTH_HOST_DEVICE void offer(const Nearest& o) {
    if (o.distance2 < distance2 || (o.distance2 == distance2 && o.index < index)) *this = o;
  }
};

/// Along one axis, from a place to a layer of bricks; a little short, so that rounding loses no point.
BOOTH_HOST_DEVICE float gap(const FieldFrame& f, int axis, std::int32_t layer, float place) {
  const float low = f.origin[axis] + static_cast<float>(layer) * f.edge - 1e-4f, high = low + f.edge + 2e-4f;
  return low > place ? low - place : place > high ? place - high : 0.0f;
}

/// Looks at the points of row (y, z) that may be nearer than the best so far, every kStep-th from `from` on.
template <int kStep>
BOOTH_HOST_DEVICE void search_row(const FieldMemory& m, const FieldFrame& f, std::int32_t y, std::int32_t z, const float* place, int from, Nearest& best) {
  if (y < 0 || z < 0 || y >= f.bricks[1] || z >= f.bricks[2]) return;
  const std::int32_t* start = m.start + (z * f.bricks[1] + y) * (f.bricks[0] + 1);
  if (start[0] == start[f.bricks[0]]) return;
  const float gy = gap(f, 1, y, place[1]), gz = gap(f, 2, z, place[2]), rest = best.distance2 - (gy * gy + gz * gz);
  if (rest < 0) return;
  const float reach = sqrtf(rest) + 1e-4f;
  const auto layer = [&](float x) {
    const std::int32_t i = static_cast<std::int32_t>((x - f.origin[0]) / f.edge);
    return i < 0 ? 0 : i > f.bricks[0] - 1 ? f.bricks[0] - 1 : i;
  };
  // Whose turn a point is goes by its place among all points: the reaches, and so the beginnings, of those who share them differ.
  const std::int32_t begin = start[layer(place[0] - reach)];
  for (std::int32_t e = begin + (from + kStep - begin % kStep) % kStep, end = start[layer(place[0] + reach) + 1]; e < end; e += kStep)
    best.offer(m.sorted[e], place[0], place[1], place[2]);
}

/// All rows around (y, z), the nearest first: they hold the nearest points, and spare most of the others.
template <int kStep>
BOOTH_HOST_DEVICE void search_rows(const FieldMemory& m, const FieldFrame& f, std::int32_t y, std::int32_t z, int layers, const float* place, int from,
                                   Nearest& best) {
  for (int r = 0; r <= layers; ++r) {
    const float least = static_cast<float>(r - 1) * f.edge;  // the place is somewhere in its own row
    if (r > 1 && least * least > best.distance2) return;
    for (std::int32_t k = -r; k <= r; ++k) {
      search_row<kStep>(m, f, y + k, z - r, place, from, best);
      if (r > 0) search_row<kStep>(m, f, y + k, z + r, place, from, best);
    }
    for (std::int32_t k = 1 - r; k < r; ++k) {
      search_row<kStep>(m, f, y - r, z + k, place, from, best);
      search_row<kStep>(m, f, y + r, z + k, place, from, best);
    }
  }
}

BOOTH_HOST_DEVICE std::int32_t pack_point(const FieldFrame& f, const float* corner, const Nearest& n) {
  const float per_step = kBrick / (f.edge * f.step);
  const std::int32_t x = static_cast<std::int32_t>(floorf((n.x - corner[0]) * per_step + 0.5f)),
                     y = static_cast<std::int32_t>(floorf((n.y - corner[1]) * per_step + 0.5f)),
                     z = static_cast<std::int32_t>(floorf((n.z - corner[2]) * per_step + 0.5f));
  const auto fits = [](std::int32_t o) { return o >= -kOffsetLimit && o <= kOffsetLimit; };
  return fits(x) && fits(y) && fits(z) ? pack_offset(x, y, z) : kNoPoint;
}

/// Every brick looks for the point nearest to its centre: kTeam threads share its points.
struct DescribeBricks {
  static constexpr int kThreads = 128, kPhases = 2, kTeam = 8, kSide = kThreads / kTeam;
  struct Shared {
    Nearest best[kThreads];
  };
  struct Private {};
  explicit DescribeBricks(const FieldMemory& memory) : m(memory) {}
  FieldMemory m;

  BOOTH_HOST_DEVICE int rounds(const Lane& lane) const { return (m.local_frame->total() + lane.blocks * kSide - 1) / (lane.blocks * kSide); }
  template <int kPhase>
  BOOTH_HOST_DEVICE bool runs(int) const {
    return true;
  }

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int round, Shared& s, Private&) const {
    const FieldFrame& f = *m.local_frame;
    const std::int32_t b = (round * lane.blocks + lane.block) * kSide + lane.thread / kTeam;
    if (b >= f.total()) return;
    const std::int32_t nx = f.bricks[0], ny = f.bricks[1], at[3] = {b % nx, b / nx % ny, b / (nx * ny)};
    float corner[3], centre[3];
    bool border = f.points == 0;
    for (int c = 0; c < 3; ++c) {
      corner[c] = f.origin[c] + static_cast<float>(at[c]) * f.edge, centre[c] = corner[c] + 0.5f * f.edge;
      border = border || at[c] == 0 || at[c] == f.bricks[c] - 1;  // clamped look-ups end there
    }
    if constexpr (kPhase == 0) {
      const float reach = f.band + 0.8661f * f.edge;  // half a brick's diagonal: some vertex in the brick may be within the band
      Nearest best{reach * reach, kNobody, 0, 0, 0};
      if (!border) search_rows<kTeam>(m, f, at[1], at[2], static_cast<int>(reach / f.edge + 0.5f), centre, lane.thread % kTeam, best);
      s.best[lane.thread] = best;
    } else if (lane.thread % kTeam == 0) {
      Nearest best = s.best[lane.thread];
      for (int i = 1; i < kTeam; ++i) best.offer(s.best[lane.thread + i]);
      m.distance[b] = sqrtf(best.distance2);
      const bool found = best.index != kNobody, fine = found && m.distance[b] <= f.fine;
      m.cell[1 + b] = found ? pack_point(f, corner, best) : kNoPoint;
      m.brick[b] = fine ? 1 + m.max_bricks + b * kBrickCells : ~(1 + b);
    }
  }
};

/// Every cell of a brick near the cloud looks for the point nearest to its own centre. A block takes four bricks at a time, 64 threads each.
struct DescribeCells : OneRound {
  static constexpr int kThreads = 256, kPhases = 1;
  struct Shared {};
  struct Private {};
  explicit DescribeCells(const FieldMemory& memory) : m(memory) {}
  FieldMemory m;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int, Shared&, Private&) const {
    const FieldFrame& f = *m.local_frame;
    constexpr int kSide = kThreads / kBrickCells;
    const std::int32_t total = f.total();
    for (std::int32_t b = lane.block * kSide + lane.thread / kBrickCells; b < total; b += lane.blocks * kSide)
      if (m.brick[b] >= 0) describe(f, b, lane.thread % kBrickCells);
  }

  BOOTH_HOST_DEVICE void describe(const FieldFrame& f, std::int32_t b, int local) const {
    const std::int32_t nx = f.bricks[0], ny = f.bricks[1], at[3] = {b % nx, b / nx % ny, b / (nx * ny)};
    const float cell = f.edge / kBrick;
    const int inside[3] = {local & 3, local >> 2 & 3, local >> 4};
    float corner[3], centre[3];
    for (int c = 0; c < 3; ++c) {
      corner[c] = f.origin[c] + static_cast<float>(at[c]) * f.edge;
      centre[c] = corner[c] + (static_cast<float>(inside[c]) + 0.5f) * cell;
    }
    // The brick's own nearest point is nowhere further from a cell's centre than this; half a diagonal of the centres' box is 2.6 cells.
    const float reach = m.distance[b] + 2.61f * cell;
    Nearest best{reach * reach, kNobody, 0, 0, 0};
    search_rows<1>(m, f, at[1], at[2], 1 + static_cast<int>((reach - 0.5f * cell) / f.edge), centre, 0, best);
    m.cell[1 + m.max_bricks + b * kBrickCells + local] = best.index == kNobody ? kNoPoint : pack_point(f, corner, best);
  }
};

}  // namespace booth::fit::device

// Builds the nearest-point field (fit/cloud/field_view.hpp) on a device: points sorted by brick, then exact searches that every brick and cell does by itself.
#pragma once

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
  const FieldFrame* frame;            ///< pinned
  const float* cloud;                 ///< pinned: x of all points, then y, then z, `capacity` floats each
  std::int32_t capacity, max_bricks;
  FieldFrame* local_frame;            ///< the device's own copy
  FieldView* view;
  std::int32_t *count, *start, *next;  ///< per brick; `start` has one more
  std::int32_t* key;                  ///< per point
  Point *given, *sorted;
  float* distance;                    ///< per brick: of the centre from the nearest point
  std::int32_t *brick, *cell;         ///< brick b answers with cell 1 + b, or with the 64 from 1 + max_bricks + 64 b on; cell 0 has no point
};

BOOTH_HOST_DEVICE std::int32_t add_one(std::int32_t* at) {
#if defined(__CUDA_ARCH__)
  return atomicAdd(at, 1);
#else
  return (*at)++;
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
    const int first = lane.block * kThreads + lane.thread, total = m.frame->total();
    for (int b = first; b < total; b += lane.blocks * kThreads) m.count[b] = 0;
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
      if (good) add_one(m.count + key);
    }
  }
};

/// Where each brick's points begin: one block adds up all counts, kThreads runs side by side.
struct StartBricks : OneRound {
  static constexpr int kThreads = 1024, kPhases = 3, kRow = 32;
  struct Shared {
    std::int32_t sum[kThreads], row[kRow];
  };
  struct Private {
    std::int32_t begin, end;
  };
  explicit StartBricks(const FieldMemory& memory) : m(memory) {}
  FieldMemory m;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int, Shared& s, Private& own) const {
    const int t = lane.thread;
    if constexpr (kPhase == 0) {
      const std::int32_t total = m.local_frame->total(), each = (total + kThreads - 1) / kThreads;
      own.begin = t * each < total ? t * each : total, own.end = own.begin + each < total ? own.begin + each : total;
      std::int32_t sum = 0;
      for (std::int32_t b = own.begin; b < own.end; ++b) sum += m.count[b];
      s.sum[t] = sum;
    } else if constexpr (kPhase == 1) {
      if (t >= kRow) return;
      std::int32_t sum = 0;
      for (int i = 0; i < kThreads / kRow; ++i) sum += s.sum[t * (kThreads / kRow) + i];
      s.row[t] = sum;
    } else {
      const int row = t / (kThreads / kRow);
      std::int32_t sum = 0;
      for (int r = 0; r < row; ++r) sum += s.row[r];
      for (int i = row * (kThreads / kRow); i < t; ++i) sum += s.sum[i];
      for (std::int32_t b = own.begin; b < own.end; ++b) {
        m.start[b] = m.next[b] = sum;
        sum += m.count[b];
      }
      if (t == kThreads - 1) m.start[m.local_frame->total()] = sum;
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
      if (const std::int32_t key = m.key[i]; key >= 0) m.sorted[add_one(m.next + key)] = m.given[i];
  }
};

/// The nearest point so far.
struct Nearest {
  float distance2;
  std::int32_t index;
  float x, y, z;

  BOOTH_HOST_DEVICE void offer(const Point& p, float cx, float cy, float cz) {
    const float dx = p.x - cx, dy = p.y - cy, dz = p.z - cz, d = dx * dx + dy * dy + dz * dz;
    if (d < distance2 || (d == distance2 && p.index < index)) distance2 = d, index = p.index, x = p.x, y = p.y, z = p.z;
  }
};

BOOTH_HOST_DEVICE std::int32_t pack_point(const FieldFrame& f, const float* corner, const Nearest& n) {
  const float per_step = kBrick / (f.edge * f.step);
  const std::int32_t x = static_cast<std::int32_t>(floorf((n.x - corner[0]) * per_step + 0.5f)), y = static_cast<std::int32_t>(floorf((n.y - corner[1]) * per_step + 0.5f)),
                     z = static_cast<std::int32_t>(floorf((n.z - corner[2]) * per_step + 0.5f));
  const auto fits = [](std::int32_t o) { return o >= -kOffsetLimit && o <= kOffsetLimit; };
  return fits(x) && fits(y) && fits(z) ? pack_offset(x, y, z) : kNoPoint;
}

/// Every brick looks for the point nearest to its centre, layer of bricks by layer.
struct DescribeBricks : OneRound {
  static constexpr int kThreads = 128, kPhases = 1;
  struct Shared {};
  struct Private {};
  explicit DescribeBricks(const FieldMemory& memory) : m(memory) {}
  FieldMemory m;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int, Shared&, Private&) const {
    const FieldFrame& f = *m.local_frame;
    const std::int32_t total = f.total();
    for (std::int32_t b = lane.block * kThreads + lane.thread; b < total; b += lane.blocks * kThreads) describe(f, b);
  }

  BOOTH_HOST_DEVICE void describe(const FieldFrame& f, std::int32_t b) const {
    const std::int32_t nx = f.bricks[0], ny = f.bricks[1], nz = f.bricks[2], at[3] = {b % nx, b / nx % ny, b / (nx * ny)};
    float corner[3], centre[3];
    bool border = f.points == 0;
    for (int c = 0; c < 3; ++c) {
      corner[c] = f.origin[c] + static_cast<float>(at[c]) * f.edge, centre[c] = corner[c] + 0.5f * f.edge;
      border = border || at[c] == 0 || at[c] == f.bricks[c] - 1;  // clamped look-ups end there
    }
    const float reach = f.band + 0.8661f * f.edge;  // half a brick's diagonal: some vertex in the brick may be within the band
    Nearest best{reach * reach, 0x7fffffff, 0, 0, 0};
    const int layers = border ? -1 : static_cast<int>(reach / f.edge + 0.5f);
    for (int r = 0; r <= layers; ++r) {
      // Points in layer r are at least (r - 1/2) edges from the centre.
      const float least = (static_cast<float>(r) - 0.5f) * f.edge;
      if (r > 0 && least * least > best.distance2) break;
      const auto limit = [](std::int32_t v, std::int32_t n) { return v < 0 ? 0 : v > n - 1 ? n - 1 : v; };
      for (std::int32_t z = limit(at[2] - r, nz); z <= limit(at[2] + r, nz); ++z)
        for (std::int32_t y = limit(at[1] - r, ny); y <= limit(at[1] + r, ny); ++y) {
          const std::int32_t row = (z * ny + y) * nx, x0 = limit(at[0] - r, nx), x1 = limit(at[0] + r, nx);
          const bool whole = z == at[2] - r || z == at[2] + r || y == at[1] - r || y == at[1] + r;
          if (whole) {
            scan(row + x0, row + x1, centre, best);
          } else {  // only the two ends are new
            if (at[0] - r >= 0) scan(row + x0, row + x0, centre, best);
            if (at[0] + r < nx) scan(row + x1, row + x1, centre, best);
          }
        }
    }
    m.distance[b] = sqrtf(best.distance2);
    const bool found = best.index != 0x7fffffff, fine = found && m.distance[b] <= f.fine;
    m.cell[1 + b] = found ? pack_point(f, corner, best) : kNoPoint;
    m.brick[b] = fine ? 1 + m.max_bricks + b * kBrickCells : ~(1 + b);
  }

  BOOTH_HOST_DEVICE void scan(std::int32_t first, std::int32_t last, const float* centre, Nearest& best) const {
    for (std::int32_t e = m.start[first], end = m.start[last + 1]; e < end; ++e) best.offer(m.sorted[e], centre[0], centre[1], centre[2]);
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
    const std::int32_t nx = f.bricks[0], ny = f.bricks[1], nz = f.bricks[2], at[3] = {b % nx, b / nx % ny, b / (nx * ny)};
    const float cell = f.edge / kBrick;
    const int inside[3] = {local & 3, local >> 2 & 3, local >> 4};
    float corner[3], centre[3];
    for (int c = 0; c < 3; ++c) {
      corner[c] = f.origin[c] + static_cast<float>(at[c]) * f.edge;
      centre[c] = corner[c] + (static_cast<float>(inside[c]) + 0.5f) * cell;
    }
    // The brick's own nearest point is nowhere further from a cell's centre than this; half a diagonal of the centres' box is 2.6 cells.
    const float reach = m.distance[b] + 2.61f * cell;
    Nearest best{reach * reach, 0x7fffffff, 0, 0, 0};
    const int layers = 1 + static_cast<int>((reach - 0.5f * cell) / f.edge);
    const auto limit = [](std::int32_t v, std::int32_t n) { return v < 0 ? 0 : v > n - 1 ? n - 1 : v; };
    // Rows beside the brick first: they hold the nearest points, and spare most of the others.
    for (int r = 0; r <= layers; ++r)
      for (std::int32_t z = at[2] - r; z <= at[2] + r; ++z)
        for (std::int32_t y = at[1] - r; y <= at[1] + r; ++y) {
          if (z < 0 || z >= nz || y < 0 || y >= ny || (z != at[2] - r && z != at[2] + r && y != at[1] - r && y != at[1] + r)) continue;
          const float gy = gap(f, 1, y, centre[1]), gz = gap(f, 2, z, centre[2]);
          if (gy * gy + gz * gz > best.distance2) continue;
          const std::int32_t row = (z * ny + y) * nx;
          for (std::int32_t e = m.start[row + limit(at[0] - layers, nx)], end = m.start[row + limit(at[0] + layers, nx) + 1]; e < end; ++e)
            best.offer(m.sorted[e], centre[0], centre[1], centre[2]);
        }
    m.cell[1 + m.max_bricks + b * kBrickCells + local] = best.index == 0x7fffffff ? kNoPoint : pack_point(f, corner, best);
  }

  /// Along one axis, from a place to a layer of bricks; a little short, so that rounding loses no point.
  BOOTH_HOST_DEVICE static float gap(const FieldFrame& f, int axis, std::int32_t layer, float place) {
    const float low = f.origin[axis] + static_cast<float>(layer) * f.edge - 1e-4f, high = low + f.edge + 2e-4f;
    return low > place ? low - place : place > high ? place - high : 0.0f;
  }
};

}  // namespace booth::fit::device

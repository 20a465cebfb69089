// Builds the nearest-point field (brick_view.hpp) on a device from points sorted by brick: exact searches for every brick and for every cell near the
// cloud.
#pragma once

#include <math.h>

#include <cstdint>

#include "fit/gpu/host_device.hpp"
#include "fit/gpu/launch.hpp"
#include "fit/swarm/device/brick_view.hpp"
#include "fit/swarm/device/point_kernels.hpp"

namespace booth::fit::device {

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

/// Where a brick lies.
struct BrickPlace {
  std::int32_t at[3];
  float corner[3], centre[3];
  bool border;  ///< clamped look-ups end there, so it never answers; likewise where there are no points at all

  BOOTH_HOST_DEVICE BrickPlace(const FieldFrame& f, std::int32_t b) : border(f.points == 0) {
    at[0] = b % f.bricks[0], at[1] = b / f.bricks[0] % f.bricks[1], at[2] = b / (f.bricks[0] * f.bricks[1]);
    for (int c = 0; c < 3; ++c) {
      corner[c] = f.origin[c] + static_cast<float>(at[c]) * f.edge, centre[c] = corner[c] + 0.5f * f.edge;
      border = border || at[c] == 0 || at[c] == f.bricks[c] - 1;
    }
  }
};

/// Every brick looks for the point nearest to its centre. A team of threads first asks each row of bricks around how far its nearest occupied brick is, then
/// looks at the points of the one that promises most, then at the rows that may hold a nearer one.
struct DescribeBricks {
  static constexpr int kThreads = 128, kPhases = 5, kTeam = 8, kSide = kThreads / kTeam, kListed = 256;
  struct Shared {
    Nearest first[kThreads], best[kThreads];
    float promise[kThreads];           ///< square of how far the promising brick's furthest corner may be
    std::int32_t promising[kThreads];  ///< its place in m.start; -1: none is within reach
    std::int32_t listed[kSide];
    std::int16_t row[kSide][kListed];  ///< as each_row() counts them
  };
  struct Private {};
  explicit DescribeBricks(const FieldMemory& memory) : m(memory) {}
  FieldMemory m;

  BOOTH_HOST_DEVICE int rounds(const Lane& lane) const { return (m.frame->total() + lane.blocks * kSide - 1) / (lane.blocks * kSide); }
  template <int kPhase>
  BOOTH_HOST_DEVICE bool runs(int) const {
    return true;
  }

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int round, Shared& s, Private&) const {
    const FieldFrame& f = *m.frame;
    const std::int32_t b = (round * lane.blocks + lane.block) * kSide + lane.thread / kTeam;
    if (b >= f.total()) return;
    const BrickPlace place(f, b);
    const int t = lane.thread, team = t / kTeam, leader = team * kTeam, member = t % kTeam;
    const float reach = f.band + 0.8661f * f.edge;  // half a brick's diagonal: some vertex in the brick may be within the band
    const int layers = static_cast<int>(reach / f.edge + 0.5f);
    if constexpr (kPhase == 0) {
      float promise = 3e38f;
      std::int32_t promising = -1;
      if (!place.border)
        each_row(
            f, place, layers, layers, member, [&](float gy, float gz) { return far2(f, 0, gy, gz) < promise && least2(f, 0, gy, gz) <= reach * reach; },
            [&](int, std::int32_t y, std::int32_t z, float gx, float gy, float gz, std::int32_t x) {
              const float far = far2(f, gx, gy, gz);
              if (far < promise && least2(f, gx, gy, gz) <= reach * reach) promise = far, promising = (z * f.bricks[1] + y) * (f.bricks[0] + 1) + x;
            });
      s.promise[t] = promise, s.promising[t] = promising;
      if (member == 0) s.listed[team] = 0;
    } else if constexpr (kPhase == 1) {
      Nearest best{reach * reach, kNobody, 0, 0, 0};
      if (const std::int32_t at = most_promising(s, leader); at >= 0)
        for (std::int32_t e = m.start[at] + member, end = m.start[at + 1]; e < end; e += kTeam)
          best.offer(m.sorted[e], place.centre[0], place.centre[1], place.centre[2]);
      s.first[t] = best;
    } else if constexpr (kPhase == 2) {
      if (most_promising(s, leader) < 0) return;
      const float distance2 = of_team(s.first, leader).distance2;
      // Where a point is near only the rows close by can hold a nearer one; a tenth of a brick more, so that rounding loses none.
      const int near = static_cast<int>(sqrtf(distance2) / f.edge + 0.6f);
      each_row(
          f, place, layers, near < layers ? near : layers, member, [&](float gy, float gz) { return least2(f, 0, gy, gz) <= distance2; },
          [&](int row, std::int32_t, std::int32_t, float gx, float gy, float gz, std::int32_t) {
            if (least2(f, gx, gy, gz) > distance2) return;
            const std::int32_t at = add(&s.listed[team], 1);
            if (at < kListed) s.row[team][at] = static_cast<std::int16_t>(row);
          });
    } else if constexpr (kPhase == 3) {
      Nearest best = of_team(s.first, leader);
      if (s.listed[team] > kListed)
        search_rows<kTeam>(m, f, place.at[1], place.at[2], layers, place.centre, member, best);
      else  // the team shares each row's points: a row a thread was slower by a quarter
        for (std::int32_t i = 0, across = 2 * layers + 1; i < s.listed[team]; ++i)
          search_row<kTeam>(m, f, place.at[1] + s.row[team][i] % across - layers, place.at[2] + s.row[team][i] / across - layers, place.centre, member, best);
      s.best[t] = best;
    } else if (member == 0) {
      const Nearest best = of_team(s.best, leader);
      const bool found = best.index != kNobody, fine = found && sqrtf(best.distance2) <= f.fine;
      m.cell[1 + b] = found ? pack_point(f, place.corner, best) : kNoPoint;
      m.brick[b] = fine ? 1 + m.max_bricks + b * kBrickCells : ~(1 + b);
      if (!fine) return;
      m.fine_list[add(m.fine_count, 1)] = b;
      m.nearest[b] = {best.x, best.y, best.z, best.index};
    }
  }

 private:
  BOOTH_HOST_DEVICE static float square(float x) { return x * x; }
  /// From a brick's centre to a brick so many away along each axis, at least; a little less, so that rounding loses no point.
  BOOTH_HOST_DEVICE static float least2(const FieldFrame& f, float gx, float gy, float gz) {
    const auto near = [&](float g) { return g > 0 ? (g - 0.5f) * f.edge - 1e-4f : 0.0f; };
    return square(near(gx)) + square(near(gy)) + square(near(gz));
  }
  /// ... and at most, where it has a point. Both sum squares in one order, so that with less of one axis they are never more.
  BOOTH_HOST_DEVICE static float far2(const FieldFrame& f, float gx, float gy, float gz) {
    return square((gx + 0.5f) * f.edge) + square((gy + 0.5f) * f.edge) + square((gz + 0.5f) * f.edge);
  }
  /// Of the rows at most `reached` of `layers` away along y and z, a team's member takes every kTeam-th. It looks at those that may be worth it, by how far
  /// they are, worth(y, z), and visits the ones that have points: visit(row, y, z, bricks away along x, y and z, x of the nearest brick that has some).
  template <class Worth, class Visit>
  BOOTH_HOST_DEVICE void each_row(const FieldFrame& f, const BrickPlace& place, int layers, int reached, int member, const Worth& worth,
                                  const Visit& visit) const {
    const int across = 2 * reached + 1;
    int dy = member % across - reached, dz = member / across - reached;
    while (dz <= reached) {
      const std::int32_t y = place.at[1] + dy, z = place.at[2] + dz;
      const float gy = static_cast<float>(dy < 0 ? -dy : dy), gz = static_cast<float>(dz < 0 ? -dz : dz);
      if (y >= 0 && y < f.bricks[1] && z >= 0 && z < f.bricks[2] && worth(gy, gz)) {
        const int dx = m.across[(z * f.bricks[1] + y) * f.bricks[0] + place.at[0]];
        if (dx != kNoneAcross) visit((dz + layers) * (2 * layers + 1) + dy + layers, y, z, static_cast<float>(dx < 0 ? -dx : dx), gy, gz, place.at[0] + dx);
      }
      for (dy += kTeam; dy > reached; dy -= across) ++dz;
    }
  }
  BOOTH_HOST_DEVICE static std::int32_t most_promising(const Shared& s, int leader) {
    int winner = leader;
    for (int i = leader + 1; i < leader + kTeam; ++i) winner = s.promise[i] < s.promise[winner] ? i : winner;
    return s.promising[winner];
  }
  BOOTH_HOST_DEVICE static Nearest of_team(const Nearest* all, int leader) {
    Nearest best = all[leader];
    for (int i = 1; i < kTeam; ++i) best.offer(all[leader + i]);
    return best;
  }
};

/// Every cell of a brick near the cloud looks for the point nearest to its own centre. A block takes a brick at a time: it collects the points that may be
/// the nearest to any cell, then kTeam threads a cell compare them.
struct DescribeCells {
  static constexpr int kThreads = 256, kPhases = 4, kWarp = 32, kTeam = kThreads / kBrickCells, kCandidates = 4096;
  struct Shared {
    std::int32_t candidate[kCandidates];  ///< places in m.sorted; deep inside a body thousands are about equally near
    Nearest best[kThreads];
    std::int32_t candidates;
  };
  struct Private {};
  explicit DescribeCells(const FieldMemory& memory) : m(memory) {}
  FieldMemory m;

  BOOTH_HOST_DEVICE int rounds(const Lane& lane) const { return (*m.fine_count - lane.block + lane.blocks - 1) / lane.blocks; }
  template <int kPhase>
  BOOTH_HOST_DEVICE bool runs(int) const {
    return true;
  }

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int round, Shared& s, Private&) const {
    const FieldFrame& f = *m.frame;
    const int t = lane.thread, local = t / kTeam, member = t % kTeam;
    const std::int32_t b = m.fine_list[round * lane.blocks + lane.block];
    if constexpr (kPhase == 0) {
      if (t == 0) s.candidates = 0;
    } else if constexpr (kPhase == 1) {
      collect(f, b, t, s);
    } else if constexpr (kPhase == 2) {
      const BrickPlace place(f, b);
      float centre[3];
      const int inside[3] = {local & 3, local >> 2 & 3, local >> 4};
      for (int c = 0; c < 3; ++c) centre[c] = place.corner[c] + (static_cast<float>(inside[c]) + 0.5f) * (f.edge / kBrick);
      Nearest best{3e38f, kNobody, 0, 0, 0};
      best.offer(m.nearest[b], centre[0], centre[1], centre[2]);
      if (s.candidates <= kCandidates) {
        for (std::int32_t i = member; i < s.candidates; i += kTeam) best.offer(m.sorted[s.candidate[i]], centre[0], centre[1], centre[2]);
      } else {  // a cloud so dense that they do not fit: each cell looks for itself
        const int layers = 1 + static_cast<int>((sqrtf(best.distance2) + 1e-4f) / f.edge);
        search_rows<kTeam>(m, f, place.at[1], place.at[2], layers, centre, member, best);
      }
      s.best[t] = best;
    } else if (member == 0) {
      Nearest best = s.best[t];
      for (int i = 1; i < kTeam; ++i) best.offer(s.best[t + i]);
      m.cell[1 + m.max_bricks + b * kBrickCells + local] = pack_point(f, BrickPlace(f, b).corner, best);
    }
  }

 private:
  /// Let q be the point nearest to the brick's centre and p another, both seen from there. For a cell's centre c, which is within h of it along each axis, p
  /// can be the nearest only if |p - c| <= |q - c|, that is |p|^2 - |q|^2 <= 2 c (p - q) <= 2 h |p - q|_1; and no point is further from the box of those
  /// centres than q from its furthest corner.
  BOOTH_HOST_DEVICE void collect(const FieldFrame& f, std::int32_t b, int t, Shared& s) const {
    const BrickPlace place(f, b);
    const float h = 1.5f * (f.edge / kBrick);
    const Point nearest = m.nearest[b];
    const float q[3] = {nearest.x - place.centre[0], nearest.y - place.centre[1], nearest.z - place.centre[2]};
    const float q2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
    float reach2 = 0;
    for (int c = 0; c < 3; ++c) reach2 += (fabsf(q[c]) + h) * (fabsf(q[c]) + h);
    const int layers = 1 + static_cast<int>((sqrtf(reach2) + 1e-4f) / f.edge), across = 2 * layers + 1;
    for (int r = t / kWarp; r < across * across; r += kThreads / kWarp) {
      const std::int32_t y = place.at[1] + r % across - layers, z = place.at[2] + r / across - layers;
      if (y < 0 || z < 0 || y >= f.bricks[1] || z >= f.bricks[2]) continue;
      const std::int32_t* start = m.start + (z * f.bricks[1] + y) * (f.bricks[0] + 1);
      const auto off = [&](int axis, std::int32_t layer) {  // the box of the centres is so far from a layer of bricks
        const float g = gap(f, axis, layer, place.centre[axis]) - h;
        return g > 0 ? g : 0.0f;
      };
      const float gy = off(1, y), gz = off(2, z), rest = reach2 - (gy * gy + gz * gz);
      if (rest < 0) continue;
      const float reach = sqrtf(rest) + h + 1e-4f;
      const int dx = m.across[(z * f.bricks[1] + y) * f.bricks[0] + place.at[0]];
      // The row's nearest points lie beyond, by a tenth of a brick at least, so that rounding loses none.
      if (dx == kNoneAcross || (static_cast<float>(dx < 0 ? -dx : dx) - 0.6f) * f.edge > reach) continue;
      const auto layer = [&](float x) {
        const std::int32_t i = static_cast<std::int32_t>((x - f.origin[0]) / f.edge);
        return i < 0 ? 0 : i > f.bricks[0] - 1 ? f.bricks[0] - 1 : i;
      };
      const std::int32_t end = start[layer(place.centre[0] + reach) + 1];
      for (std::int32_t e = start[layer(place.centre[0] - reach)] + t % kWarp; e < end; e += kWarp) {
        const Point p = m.sorted[e];
        const float v[3] = {p.x - place.centre[0], p.y - place.centre[1], p.z - place.centre[2]};
        const float more = v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - q2;
        if (more > 2 * h * (fabsf(v[0] - q[0]) + fabsf(v[1] - q[1]) + fabsf(v[2] - q[2])) + 1e-7f) continue;
        const std::int32_t at = add(&s.candidates, 1);
        if (at < kCandidates) s.candidate[at] = e;
      }
    }
  }
};

}  // namespace booth::fit::device

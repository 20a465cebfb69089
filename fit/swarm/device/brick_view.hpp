// The nearest-point field as a device's kernels see it: two levels of flat arrays, exact, and its look-up.
#pragma once

#include <cstdint>

#include "fit/gpu/host_device.hpp"

namespace booth::fit {

/// The CPU's field is another (fit/cloud/cell_view.hpp): one level, about the nearest, one load a look-up; a device has the arithmetic for exact answers and
/// would rather not clear 7 MB a frame.
///
/// The box is cut into bricks of 4 x 4 x 4 cells. A brick near the cloud has 64 cells, each with the point nearest to its own centre; a brick
/// further away has one, with the point nearest to the brick's centre (the distance is flat there); one off the band has none. Everything is in
/// cells from `origin`; the outermost layer of bricks is always off the band, so that a clamped look-up falls there.
///
/// brick[(bz * bricks_y + by) * bricks_x + bx] is the index in `cell` of the first of its 64 cells, or ~index (negative) of its only one.
/// Within a brick the cell of (x, y, z) is x + 4 y + 16 z. A cell holds the nearest point's offset from its BRICK's low corner, three times 10 bits,
/// signed, x lowest, in steps of `step` cells; a negative cell means that there is no point within the band.
struct BrickView {
  const std::int32_t* brick = nullptr;
  const std::int32_t* cell = nullptr;
  float origin[3] = {0, 0, 0};     ///< m
  float cell_size = 1;             ///< m
  float inverse_cell = 1;          ///< 1 / m
  float last[3] = {0, 0, 0};       ///< cells; look-ups are clamped to [0, last]
  std::int32_t brick_strides = 0;  ///< bricks_x in the low half, bricks_x * bricks_y (below 32768) in the high half
  float step = 1;                  ///< cells
};

inline constexpr int kBrick = 4;  ///< cells along a brick's edge
inline constexpr int kBrickCells = 64;
inline constexpr int kOffsetLimit = 511;  ///< largest magnitude of an offset's ten bits
inline constexpr std::int32_t kNoPoint = -0x7fffffff - 1;

/// A cell's value from offsets in steps; each must be within +-kOffsetLimit.
BOOTH_HOST_DEVICE std::int32_t pack_offset(int x, int y, int z) { return (x & 1023) | (y & 1023) << 10 | (z & 1023) << 20; }

/// Where to look: the index of the brick, and within it of the cell. (x, y, z), in cells from the origin, become relative to the brick's low corner.
/// Infinite and not-a-number coordinates are safe: they are clamped (NaN to 0), that is, off the band.
template <class L>
BOOTH_HOST_DEVICE void locate(const BrickView& f, typename L::F& x, typename L::F& y, typename L::F& z, typename L::I& brick, typename L::I& local) {
  using F = typename L::F;
  using I = typename L::I;
  const auto clamped = [](F v, float last) { return L::truncate(L::smaller(L::larger(v, L::splat(0.0f)), L::splat(last))); };
  const I ix = clamped(x, f.last[0]), iy = clamped(y, f.last[1]), iz = clamped(z, f.last[2]);
  brick = L::pair_dot(ix >> 2, (iy >> 2) | (iz >> 2) << 16, L::splat(f.brick_strides));
  local = (ix & 3) | (iy & 3) << 2 | (iz & 3) << 4;
  x = x - L::to_float(ix & ~3), y = y - L::to_float(iy & ~3), z = z - L::to_float(iz & ~3);
}

/// The index of the cell that answers, given the brick's entry.
template <class L>
BOOTH_HOST_DEVICE typename L::I cell_of(typename L::I entry, typename L::I local) {
  const typename L::I far = entry >> 31;
  return (entry ^ far) + (local & ~far);
}

/// (x, y, z), relative to the brick's low corner, less the nearest point, in cells; true (lane by lane) where there is no point within the band, with an
/// undefined difference.
template <class L>
BOOTH_HOST_DEVICE auto subtract_nearest(const BrickView& f, typename L::I cell, typename L::F& x, typename L::F& y, typename L::F& z) {
  x = x - L::to_float((cell << 22) >> 22) * f.step;
  y = y - L::to_float((cell << 12) >> 22) * f.step;
  z = z - L::to_float((cell << 2) >> 22) * f.step;
  return cell < L::splat(std::int32_t{0});
}

/// All three steps: (x, y, z), in cells from the origin, becomes its difference from the nearest point.
template <class L>
BOOTH_HOST_DEVICE auto field_difference(const BrickView& f, typename L::F& x, typename L::F& y, typename L::F& z) {
  std::int32_t at[L::kCount];
  typename L::I brick, local;
  locate<L>(f, x, y, z, brick, local);
  L::store(at, brick);
  L::store(at, cell_of<L>(L::gather(f.brick, at), local));
  return subtract_nearest<L>(f, L::gather(f.cell, at), x, y, z);
}

}  // namespace booth::fit

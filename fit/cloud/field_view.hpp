// The nearest-point field as kernels see it: flat arrays and the one look-up that host and device share.
#pragma once

#include <cstdint>

#include "fit/host_device.hpp"

namespace booth::fit {

/// Two levels. The box is cut into bricks of 4 x 4 x 4 cells. A brick near the cloud has 64 cells, each with the point nearest to its own centre; a brick
/// further away has one, with the point nearest to the brick's centre (the distance is flat there); one off the band has none. Everything is in
/// cells from `origin`; the outermost layer of bricks is always off the band, so that a clamped look-up falls there.
///
/// brick[(bz * bricks_y + by) * bricks_x + bx] is the index in `cell` of the first of its 64 cells, or ~index (negative) of its only one.
/// Within a brick the cell of (x, y, z) is x + 4 y + 16 z. A cell holds the nearest point's offset from its BRICK's low corner, three times 10 bits,
/// signed, x lowest, in steps of `step` cells; a negative cell means that there is no point within the band.
struct FieldView {
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

/// The cell that answers for (x, y, z), in cells from the origin. `ix`, `iy`, `iz` come back as the low corner of its brick.
/// Infinite and not-a-number coordinates are safe: they are clamped (NaN to 0), that is, off the band.
template <class L>
BOOTH_HOST_DEVICE typename L::I look_up(const FieldView& f, typename L::F x, typename L::F y, typename L::F z, typename L::I& ix, typename L::I& iy,
                                        typename L::I& iz) {
  using F = typename L::F;
  using I = typename L::I;
  const auto clamped = [](F v, float last) {
    v = v > L::splat(0.0f) ? v : L::splat(0.0f);
    return v < L::splat(last) ? v : L::splat(last);
  };
  ix = L::truncate(clamped(x, f.last[0])), iy = L::truncate(clamped(y, f.last[1])), iz = L::truncate(clamped(z, f.last[2]));
  const I local = (ix & 3) | (iy & 3) << 2 | (iz & 3) << 4;
  const I entry = L::gather(f.brick, L::pair_dot(ix >> 2, (iy >> 2) | (iz >> 2) << 16, L::splat(f.brick_strides)));
  const I far = entry >> 31;
  const I value = L::gather(f.cell, (entry ^ far) + (local & ~far));
  ix = ix & ~3, iy = iy & ~3, iz = iz & ~3;
  return value;
}

/// Difference (x, y, z) less the nearest point, in cells; true (lane by lane) where there is no point within the band, with an undefined difference.
template <class L>
BOOTH_HOST_DEVICE auto field_difference(const FieldView& f, typename L::F x, typename L::F y, typename L::F z, typename L::F& dx, typename L::F& dy,
                                        typename L::F& dz) {
  typename L::I ix, iy, iz;
  const typename L::I value = look_up<L>(f, x, y, z, ix, iy, iz);
  dx = (x - L::to_float(ix)) - L::to_float((value << 22) >> 22) * f.step;
  dy = (y - L::to_float(iy)) - L::to_float((value << 12) >> 22) * f.step;
  dz = (z - L::to_float(iz)) - L::to_float((value << 2) >> 22) * f.step;
  return value < L::splat(std::int32_t{0});
}

}  // namespace booth::fit

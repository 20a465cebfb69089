// The nearest-point field as the CPU's kernels see it: a grid of words, one look-up a query.
#pragma once

#include <cstdint>

#include "fit/gpu/host_device.hpp"

namespace booth::fit {

/// (A device's kernels have another: fit/swarm/device/brick_view.hpp.)
///
/// A cell's word says where the point is that is (about) nearest to the cell's centre, relative to that: Z * 2^22 + Y * 2^11 + X, modulo 2^32, with X and Y
/// in steps of 1/32 cell and Z in steps of 1/16, each up to 31 cells to either side. As that is linear, a word plus the word of a difference is the word of
/// the sum, and each coordinate is read off by shifting the ones above it out: as a signed number of 32 bits it is the coordinate times 2^26 (y with a share
/// of 1/2048 of x, z with 1/1024 of y: less than half a step). A word below kAnyPoint says that there is no point within the band.
struct CellView {
  const std::int32_t* middle = nullptr;  ///< the word of the cell at the origin; x fastest; the outermost cells have no point
  float origin[3] = {0, 0, 0};           ///< m; the centre of a cell in the middle of the grid
  float cell_size = 1;                   ///< m
  float inverse_cell = 1;                ///< 1 / m
  float reach[3] = {0, 0, 0};            ///< whole cells; look-ups are clamped to [-reach, reach]
  float stride_y = 0, stride_z = 0;      ///< cells; there are at most 2^24, which a float counts exactly
};

namespace cells {

inline constexpr std::int32_t kNoPoint = -0x7fffffff - 1;
inline constexpr std::int32_t kAnyPoint = kNoPoint + (1 << 22);
inline constexpr float kUnit = 1.0f / (1 << 26);  ///< cells

/// The word of a difference in steps (modulo 2^32).
constexpr std::int32_t word(int x, int y, int z) {
  return static_cast<std::int32_t>((static_cast<std::uint32_t>(z) << 22) + (static_cast<std::uint32_t>(y) << 11) + static_cast<std::uint32_t>(x));
}

}  // namespace cells

/// Where to look: the cell's index from the middle. (x, y, z), in cells from the origin, become relative to the cell's centre. Infinite and not-a-number
/// coordinates are safe: they are clamped to a cell without a point.
template <class L>
BOOTH_HOST_DEVICE typename L::I locate(const CellView& f, typename L::F& x, typename L::F& y, typename L::F& z) {
  using F = typename L::F;
  const F wx = L::nearest_whole(L::clamp(x, f.reach[0])), wy = L::nearest_whole(L::clamp(y, f.reach[1])), wz = L::nearest_whole(L::clamp(z, f.reach[2]));
  x = x - wx, y = y - wy, z = z - wz;
  return L::truncate(L::multiply_add(wz, L::splat(f.stride_z), L::multiply_add(wy, L::splat(f.stride_y), wx)));  // exact, fused or not
}

/// (x, y, z), relative to the cell's centre, less the nearest point, in cells; true (lane by lane) where there is no point within the band, with an undefined
/// difference.
template <class L>
BOOTH_HOST_DEVICE auto subtract_nearest(typename L::I word, typename L::F& x, typename L::F& y, typename L::F& z) {
  const typename L::F unit = L::splat(-cells::kUnit);  // a power of two: fused or not, the product is exact
  x = L::multiply_add(L::to_float(word << 21), unit, x);
  y = L::multiply_add(L::to_float(word << 10), unit, y);
  z = L::multiply_add(L::to_float(word), unit, z);
  return word < L::splat(cells::kAnyPoint);
}

/// Both steps: (x, y, z), in cells from the origin, becomes its difference from the nearest point.
template <class L>
BOOTH_HOST_DEVICE auto field_difference(const CellView& f, typename L::F& x, typename L::F& y, typename L::F& z) {
  std::int32_t at[L::kCount];
  L::store(at, locate<L>(f, x, y, z));
  return subtract_nearest<L>(L::gather(f.middle, at), x, y, z);
}

}  // namespace booth::fit

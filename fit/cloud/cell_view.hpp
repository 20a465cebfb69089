// The nearest-point field as the CPU's kernels see it: a grid of words, small enough for the near caches.
#pragma once

#include <cstdint>

#include "gpu/host_device.hpp"

namespace booth::fit {

/// Two levels. A cell's word says which point is (about) nearest to its centre; near the cloud it says where the words of the cell's 2 x 2 x 2 parts
/// are, each of which knows the point nearest to its own centre.
///
/// A word that answers holds where the point is, relative to the CELL's centre: Z * 2^22 + Y * 2^11 + X, modulo 2^32, with X and Y in steps of 1/64 cell and Z
/// in steps of 1/32, each up to 15 cells to either side. As that is linear, a word plus the word of a difference is the word of the sum, and each
/// coordinate is read off by shifting the ones above it out: as a signed number of 32 bits it is the coordinate times 2^27 (y with a share of 1/2048 of
/// x, z with 1/1024 of y: less than half a step). Words below kAnyPoint do not answer: in a cell, kNoPoint + i says that the parts' words begin at middle[i],
/// those with negative x, y, z at i + 1, + 2, + 4; in a part there is no point within the band.
struct CellView {
  const std::int32_t* middle = nullptr;  ///< the word of the cell at the origin; x fastest; the outermost cells have no point; the parts' are behind all cells'
  float origin[3] = {0, 0, 0};           ///< m; the centre of a cell in the middle of the grid
  float cell_size = 1;                   ///< m
  float inverse_cell = 1;                ///< 1 / m
  float reach[3] = {0, 0, 0};            ///< whole cells; look-ups are clamped to [-reach, reach]
  float stride_y = 0, stride_z = 0;      ///< cells; there are at most 2^21, which a float counts exactly
};

namespace cells {

inline constexpr std::int32_t kNoPoint = -0x7fffffff - 1;
inline constexpr std::int32_t kAnyPoint = kNoPoint + (1 << 22);
inline constexpr float kUnit = 1.0f / (1 << 27);  ///< cells

/// The word of a difference in steps (modulo 2^32).
constexpr std::int32_t word(int x, int y, int z) {
  return static_cast<std::int32_t>((static_cast<std::uint32_t>(z) << 22) + (static_cast<std::uint32_t>(y) << 11) + static_cast<std::uint32_t>(x));
}

}  // namespace cells

/// Where to look first: the cell's index from the middle, and which of its parts it would be. (x, y, z), in cells from the origin, become relative to the
/// cell's centre. Infinite and not-a-number coordinates are safe: they are clamped to a cell without a point.
template <class L>
BOOTH_HOST_DEVICE void locate(const CellView& f, typename L::F& x, typename L::F& y, typename L::F& z, typename L::I& cell, typename L::I& part) {
  using F = typename L::F;
  const F wx = L::nearest_whole(L::clamp(x, f.reach[0])), wy = L::nearest_whole(L::clamp(y, f.reach[1])), wz = L::nearest_whole(L::clamp(z, f.reach[2]));
  x = x - wx, y = y - wy, z = z - wz;
  cell = L::truncate(L::multiply_add(wz, L::splat(f.stride_z), L::multiply_add(wy, L::splat(f.stride_y), wx)));  // exact, fused or not
  part = ((L::as_int(x) >> 31) & 1) | ((L::as_int(y) >> 31) & 2) | ((L::as_int(z) >> 31) & 4);
}

/// The index of the word that answers, given the cell's.
template <class L>
BOOTH_HOST_DEVICE typename L::I answer_of(typename L::I word, typename L::I cell, typename L::I part) {
  return word < L::splat(cells::kAnyPoint) ? (word & 0x7fffffff) + part : cell;
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

/// All steps: (x, y, z), in cells from the origin, becomes its difference from the nearest point.
template <class L>
BOOTH_HOST_DEVICE auto field_difference(const CellView& f, typename L::F& x, typename L::F& y, typename L::F& z) {
  std::int32_t at[L::kCount];
  typename L::I cell, part;
  locate<L>(f, x, y, z, cell, part);
  L::store(at, cell);
  L::store(at, answer_of<L>(L::gather(f.middle, at), cell, part));
  return subtract_nearest<L>(L::gather(f.middle, at), x, y, z);
}

}  // namespace booth::fit

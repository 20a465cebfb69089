// Lossless compression of depth images that is quick enough to run beside the live path: runs of zeros, and differences in a variable number of nibbles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace booth::drivers {

/// The format of A. Wilson, "Fast Lossless Depth Image Compression" (ISS 2017), as ROS carries it in `compressedDepth rvl`: alternating lengths of runs of
/// zeros and of others, each of the others as the zigzag of its difference from the last one; all numbers in nibbles of three bits, lowest first, whose top
/// bit says that more follow; eight nibbles a little-endian word, the first in the top bits.

/// What an image of so many pixels takes at most.
constexpr std::size_t rvl_bound(std::size_t pixels) { return 3 * pixels + 32; }

/// Writes at most rvl_bound(depth.size()) bytes to `out`, which must have room for them; returns how many. Allocates nothing.
std::size_t rvl_pack(std::span<const std::uint16_t> depth, std::byte* out) noexcept;

/// Fills `depth`; false when the bytes do not describe exactly so many pixels. Whatever they hold, nothing outside of `depth` is written. Allocates nothing.
bool rvl_unpack(std::span<const std::byte> packed, std::span<std::uint16_t> depth) noexcept;

}  // namespace booth::drivers

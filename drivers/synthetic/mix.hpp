// Random bits from counters: what a simulated camera sees depends on seed, camera, frame and pixel alone, in whatever order pixels are drawn.
#pragma once

#include <cstdint>

namespace booth::drivers {

/// Finaliser of SplitMix64 (Steele, Lea, Flood 2014): every bit of `x` reaches every bit of the result. 0 stays 0.
inline std::uint64_t mix(std::uint64_t x) {
  x ^= x >> 30;
  x *= 0xbf58476d1ce4e5b9ull;
  x ^= x >> 27;
  x *= 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

}  // namespace booth::drivers

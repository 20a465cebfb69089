// One number at a time: the answer to decoder/phase_maths.hpp of a thread on a graphics processor, and of the host that emulates one.
#pragma once

#include <math.h>

#include <cstdint>

#include "fit/gpu/host_device.hpp"

namespace booth::drivers::kinect2 {

/// Bit for bit what the vectors of a processor without fused multiply-adds do in each lane (decoder/lanes.hpp).
struct OneLane {
  using F = float;
  using I = std::int32_t;
  using M = bool;
  using Codes = std::uint32_t;

  BOOTH_HOST_DEVICE static F all(float v) { return v; }
  BOOTH_HOST_DEVICE static F least(F a, F b) { return a < b ? a : b; }
  BOOTH_HOST_DEVICE static F most(F a, F b) { return a > b ? a : b; }
  BOOTH_HOST_DEVICE static F root(F a) { return sqrtf(a); }
  BOOTH_HOST_DEVICE static F down(F a) { return floorf(a); }
  BOOTH_HOST_DEVICE static F magnitude(F a) { return fabsf(a); }
  BOOTH_HOST_DEVICE static M at_least(F a, F b) { return a >= b; }
  BOOTH_HOST_DEVICE static M above(F a, F b) { return a > b; }
  BOOTH_HOST_DEVICE static M both(M a, M b) { return a && b; }
  BOOTH_HOST_DEVICE static M either(M a, M b) { return a || b; }
  BOOTH_HOST_DEVICE static bool any(M m) { return m; }
  BOOTH_HOST_DEVICE static F select(M m, F yes, F no) { return m ? yes : no; }
  BOOTH_HOST_DEVICE static F keep(M m, F a) { return m ? a : 0.0f; }
  BOOTH_HOST_DEVICE static M is_code(Codes c, std::uint16_t code) { return c == code; }
  /// The 11-bit code is a small float: sign, three bits of exponent, seven of mantissa; 2^21 times too small, as the vectors have it.
  BOOTH_HOST_DEVICE static F values(Codes c) {
    const I body = static_cast<I>((c << 3 & 0x1FF8u) << 13), sign = static_cast<I>((c << 5 & 0x8000u) << 16);
    const F size = body < 1 << 23 ? from_bits(body + (113 << 23)) - from_bits(113 << 23) : from_bits(body + (112 << 23));
    return from_bits(bits(size) | sign);
  }
  BOOTH_HOST_DEVICE static I bits(F a) { return gpu::bits_of(a); }
  BOOTH_HOST_DEVICE static F from_bits(I i) { return gpu::float_of(i); }
  BOOTH_HOST_DEVICE static F number(I a) { return static_cast<F>(a); }
  BOOTH_HOST_DEVICE static I whole(F a) { return static_cast<I>(a); }
  BOOTH_HOST_DEVICE static F shift_exponent(F a, I by) {
    return from_bits(static_cast<I>(static_cast<std::uint32_t>(bits(a)) + (static_cast<std::uint32_t>(by) << 23)));
  }
};

}  // namespace booth::drivers::kinect2

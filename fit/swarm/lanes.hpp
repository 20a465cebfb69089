// The few operations that the swarm's single-source functions ask of their numbers; this is the answer for one number at a time.
#pragma once

#include <cmath>
#include <cstdint>

#include "fit/gpu/host_device.hpp"

namespace booth::fit {

/// The functions of fit/energy/particle_energy.hpp, of the fields it asks and of fit/swarm/move.hpp are templates over such a set: one lane here (and on
/// a graphics processor), 4 to 16 in the CPU's kernels. Every operation is exact or rounds as IEEE 754 says, none crosses lanes, and fused multiply-add
/// is off but in multiply_add() of the vectors: whatever the set, a lane gets the same bits of all functions that do not use that. C++17 without the standard
/// library's templates, for the device's compiler.
struct ScalarLanes {
  using F = float;
  using I = std::int32_t;
  using U = std::uint32_t;
  static constexpr int kCount = 1;

  BOOTH_HOST_DEVICE static F splat(float x) { return x; }
  BOOTH_HOST_DEVICE static I splat(std::int32_t x) { return x; }
  BOOTH_HOST_DEVICE static U splat(std::uint32_t x) { return x; }
  BOOTH_HOST_DEVICE static F load(const float* p) { return *p; }
  BOOTH_HOST_DEVICE static void store(float* p, F x) { *p = x; }
  /// first, first + 1, ... lane by lane.
  BOOTH_HOST_DEVICE static U count_from(std::uint32_t first) { return first; }

  BOOTH_HOST_DEVICE static I as_int(F x) { return gpu::bits_of(x); }
  BOOTH_HOST_DEVICE static F as_float(I i) { return gpu::float_of(i); }
  BOOTH_HOST_DEVICE static F to_float(I i) { return static_cast<F>(i); }
  /// Towards zero; the value must fit.
  BOOTH_HOST_DEVICE static I truncate(F x) { return static_cast<I>(x); }
  /// Nearest whole number, ties to even, of |x| < 2^22.
  BOOTH_HOST_DEVICE static F nearest_whole(F x) { return (x + 12582912.0f) - 12582912.0f; }
  /// To [-limit, limit]; what is not a number becomes one or the other.
  BOOTH_HOST_DEVICE static F clamp(F x, float limit) { return smaller(larger(x, -limit), limit); }
  /// a * b + c; rounded once where the kernel's processor multiplies and adds in one instruction, else twice.
  BOOTH_HOST_DEVICE static F multiply_add(F a, F b, F c) { return a * b + c; }
  BOOTH_HOST_DEVICE static F root(F x) { return sqrtf(x); }
  BOOTH_HOST_DEVICE static F absolute(F x) { return fabsf(x); }
  /// sum + low half of a * low half of b + high half of a * high half of b; halves are signed 16 bits, the sum wraps.
  BOOTH_HOST_DEVICE static I pair_dot(I sum, I a, I b) {
    const auto low = [](I x) { return static_cast<I>(static_cast<std::int16_t>(x & 0xFFFF)); };
    return static_cast<I>(static_cast<U>(sum) + static_cast<U>(low(a) * low(b)) + static_cast<U>((a >> 16) * (b >> 16)));
  }
  /// table[at[lane]].
  BOOTH_HOST_DEVICE static I gather(const std::int32_t* table, const std::int32_t* at) { return table[*at]; }
  BOOTH_HOST_DEVICE static void store(std::int32_t* p, I x) { *p = x; }
  BOOTH_HOST_DEVICE static I load(const std::int32_t* p) { return *p; }
  /// a < b ? a : b, so the second where one is not a number; likewise larger().
  BOOTH_HOST_DEVICE static F smaller(F a, F b) { return a < b ? a : b; }
  BOOTH_HOST_DEVICE static F larger(F a, F b) { return a > b ? a : b; }
  /// All 64 bits of a * m.
  BOOTH_HOST_DEVICE static void multiply_wide(U a, std::uint32_t m, U& high, U& low) {
    const std::uint64_t product = static_cast<std::uint64_t>(a) * m;
    high = static_cast<U>(product >> 32);
    low = static_cast<U>(product);
  }
  /// Exact for values below 2^31.
  BOOTH_HOST_DEVICE static F unsigned_to_float(U x) { return static_cast<F>(static_cast<I>(x)); }
};

}  // namespace booth::fit

// The lanes of the CPU's kernels: compiler vectors, with the processor's own instruction where the compiler would not find it.
#pragma once

#include <cstdint>
#include <cstring>

#include "fit/gpu/host_device.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#ifndef BOOTH_SWARM_LANES
#error "BOOTH_SWARM_LANES must be the number of lanes: 4, 8 or 16"
#elif BOOTH_SWARM_LANES == 16 && defined(__AVX512F__) && defined(__AVX512BW__)
#define BOOTH_LANES_AVX512
#elif BOOTH_SWARM_LANES == 8 && defined(__AVX2__) && defined(__FMA__)
#define BOOTH_LANES_AVX2
#elif BOOTH_SWARM_LANES == 4 && defined(__SSE2__)
#define BOOTH_LANES_SSE2
#endif

namespace booth::fit {
// Each kernel is compiled with other flags: internal linkage keeps one kernel's code from being linked into another.
namespace {

/// See ScalarLanes for what each function means; lane by lane these give the same bits.
struct VectorLanes {
  static constexpr int kLanes = BOOTH_SWARM_LANES;
  typedef float F __attribute__((vector_size(4 * kLanes)));
  typedef std::int32_t I __attribute__((vector_size(4 * kLanes)));
  typedef std::uint32_t U __attribute__((vector_size(4 * kLanes)));
  static constexpr int kCount = kLanes;

  BOOTH_HOST_DEVICE static F splat(float x) {
#if defined(BOOTH_LANES_AVX512)
    return (F)_mm512_set1_ps(x);
#elif defined(BOOTH_LANES_AVX2)
    return (F)_mm256_set1_ps(x);
#else
    F v;
    for (int l = 0; l < kLanes; ++l) v[l] = x;
    return v;
#endif
  }
  BOOTH_HOST_DEVICE static I splat(std::int32_t x) { return I{} + x; }
  BOOTH_HOST_DEVICE static U splat(std::uint32_t x) { return U{} + x; }
  BOOTH_HOST_DEVICE static F load(const float* p) {
    F x;
    memcpy(&x, p, sizeof x);
    return x;
  }
  BOOTH_HOST_DEVICE static void store(float* p, F x) { memcpy(p, &x, sizeof x); }
  BOOTH_HOST_DEVICE static U count_from(std::uint32_t first) {
    U v;
    for (int l = 0; l < kLanes; ++l) v[l] = first + static_cast<std::uint32_t>(l);
    return v;
  }

  BOOTH_HOST_DEVICE static I as_int(F x) { return (I)x; }
  BOOTH_HOST_DEVICE static F as_float(I x) { return (F)x; }
  BOOTH_HOST_DEVICE static F to_float(I x) { return __builtin_convertvector(x, F); }
  BOOTH_HOST_DEVICE static F unsigned_to_float(U x) { return to_float((I)x); }
  BOOTH_HOST_DEVICE static I truncate(F x) { return __builtin_convertvector(x, I); }
  BOOTH_HOST_DEVICE static F absolute(F x) { return (F)((I)x & 0x7FFFFFFF); }
  BOOTH_HOST_DEVICE static F nearest_whole(F x) {
#if defined(BOOTH_LANES_AVX512)
    return (F)_mm512_roundscale_ps((__m512)x, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
#elif defined(BOOTH_LANES_AVX2)
    return (F)_mm256_round_ps((__m256)x, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC);
#else
    return (x + 12582912.0f) - 12582912.0f;
#endif
  }
  BOOTH_HOST_DEVICE static F clamp(F x, float limit) {
#if defined(BOOTH_LANES_AVX512)
    return (F)_mm512_range_ps((__m512)x, _mm512_set1_ps(limit), 2);  // the lesser magnitude with the sign of x
#else
    return smaller(larger(x, splat(-limit)), splat(limit));
#endif
  }
  BOOTH_HOST_DEVICE static F root(F x) {
#if defined(BOOTH_LANES_AVX512)
    return (F)_mm512_sqrt_ps((__m512)x);
#elif defined(BOOTH_LANES_AVX2)
    return (F)_mm256_sqrt_ps((__m256)x);
#elif defined(BOOTH_LANES_SSE2)
    return (F)_mm_sqrt_ps((__m128)x);
#else
    for (int l = 0; l < kLanes; ++l) x[l] = __builtin_sqrtf(x[l]);
    return x;
#endif
  }
  BOOTH_HOST_DEVICE static I pair_dot(I sum, I a, I b) {
#if defined(BOOTH_LANES_AVX512) && defined(__AVX512VNNI__)
    return (I)_mm512_dpwssd_epi32((__m512i)sum, (__m512i)a, (__m512i)b);
#elif defined(BOOTH_LANES_AVX512)
    return (I)_mm512_add_epi32((__m512i)sum, _mm512_madd_epi16((__m512i)a, (__m512i)b));
#elif defined(BOOTH_LANES_AVX2)
    return (I)_mm256_add_epi32((__m256i)sum, _mm256_madd_epi16((__m256i)a, (__m256i)b));
#elif defined(BOOTH_LANES_SSE2)
    return (I)_mm_add_epi32((__m128i)sum, _mm_madd_epi16((__m128i)a, (__m128i)b));
#else
    return (I)((U)sum + (U)(((a << 16) >> 16) * ((b << 16) >> 16)) + (U)((a >> 16) * (b >> 16)));
#endif
  }
  /// sum + the four products of a's bytes (0 to 255) with b's (-64 to 64).
  BOOTH_HOST_DEVICE static I quad_dot(I sum, I a, I b) {
#if defined(BOOTH_LANES_AVX512)
    return (I)_mm512_dpbusd_epi32((__m512i)sum, (__m512i)a, (__m512i)b);
#elif defined(BOOTH_LANES_AVX2)
    return (I)_mm256_add_epi32((__m256i)sum, _mm256_madd_epi16(_mm256_maddubs_epi16((__m256i)a, (__m256i)b), _mm256_set1_epi16(1)));
#elif defined(BOOTH_LANES_SSE2)
    const __m128i odd = _mm_madd_epi16(_mm_srli_epi16((__m128i)a, 8), _mm_srai_epi16((__m128i)b, 8));
    const __m128i even = _mm_madd_epi16(_mm_and_si128((__m128i)a, _mm_set1_epi16(255)), _mm_srai_epi16(_mm_slli_epi16((__m128i)b, 8), 8));
    return (I)_mm_add_epi32((__m128i)sum, _mm_add_epi32(odd, even));
#else
    sum += (a & 255) * ((b << 24) >> 24) + (a >> 8 & 255) * ((b << 16) >> 24);
    return sum + (a >> 16 & 255) * ((b << 8) >> 24) + (a >> 24 & 255) * (b >> 24);
#endif
  }
  /// a * b + c; rounded once where the kernel's processor multiplies and adds in one instruction, else twice.
  BOOTH_HOST_DEVICE static F multiply_add(F a, F b, F c) {
#if defined(BOOTH_LANES_AVX512)
    return (F)_mm512_fmadd_ps((__m512)a, (__m512)b, (__m512)c);
#elif defined(BOOTH_LANES_AVX2)
    return (F)_mm256_fmadd_ps((__m256)a, (__m256)b, (__m256)c);
#else
    return a * b + c;
#endif
  }
  /// One load a lane: measured at two thirds of the gather instruction's time (docs/design/performance.md).
  BOOTH_HOST_DEVICE static I gather(const std::int32_t* table, const std::int32_t* at) {
#if defined(BOOTH_LANES_AVX512) || defined(BOOTH_LANES_AVX2) || defined(BOOTH_LANES_SSE2)
    // Two places a load.
    const auto two = [&](int l) {
      std::int64_t both;
      memcpy(&both, at + l, sizeof both);
      return both;
    };
    const auto pair = [&](int l) {
      const std::int64_t places = two(l);
      const __m128i first = _mm_cvtsi32_si128(table[(std::int32_t)places]);
#if defined(__SSE4_1__)
      return _mm_insert_epi32(first, table[places >> 32], 1);
#else
      return _mm_unpacklo_epi32(first, _mm_cvtsi32_si128(table[places >> 32]));
#endif
    };
    const auto four = [&](int l) { return _mm_unpacklo_epi64(pair(l), pair(l + 2)); };
#endif
#if defined(BOOTH_LANES_AVX512)
    const __m256i low = _mm256_inserti128_si256(_mm256_castsi128_si256(four(0)), four(4), 1);
    const __m256i high = _mm256_inserti128_si256(_mm256_castsi128_si256(four(8)), four(12), 1);
    return (I)_mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1);
#elif defined(BOOTH_LANES_AVX2)
    return (I)_mm256_inserti128_si256(_mm256_castsi128_si256(four(0)), four(4), 1);
#elif defined(BOOTH_LANES_SSE2)
    return (I)four(0);
#else
    I out;
    for (int l = 0; l < kLanes; ++l) out[l] = table[at[l]];
    return out;
#endif
  }
  BOOTH_HOST_DEVICE static void store(std::int32_t* p, I x) { memcpy(p, &x, sizeof x); }
  BOOTH_HOST_DEVICE static I load(const std::int32_t* p) {
    I x;
    memcpy(&x, p, sizeof x);
    return x;
  }
  BOOTH_HOST_DEVICE static F smaller(F a, F b) {
#if defined(BOOTH_LANES_AVX512)
    return (F)_mm512_min_ps((__m512)a, (__m512)b);
#elif defined(BOOTH_LANES_AVX2)
    return (F)_mm256_min_ps((__m256)a, (__m256)b);
#elif defined(BOOTH_LANES_SSE2)
    return (F)_mm_min_ps((__m128)a, (__m128)b);
#else
    return a < b ? a : b;
#endif
  }
  BOOTH_HOST_DEVICE static F larger(F a, F b) {
#if defined(BOOTH_LANES_AVX512)
    return (F)_mm512_max_ps((__m512)a, (__m512)b);
#elif defined(BOOTH_LANES_AVX2)
    return (F)_mm256_max_ps((__m256)a, (__m256)b);
#elif defined(BOOTH_LANES_SSE2)
    return (F)_mm_max_ps((__m128)a, (__m128)b);
#else
    return a > b ? a : b;
#endif
  }
  BOOTH_HOST_DEVICE static void multiply_wide(U a, std::uint32_t m, U& high, U& low) {
#if defined(BOOTH_LANES_AVX512)
    const __m512i factor = _mm512_set1_epi32(static_cast<int>(m));
    const __m512i even = _mm512_mul_epu32((__m512i)a, factor), odd = _mm512_mul_epu32(_mm512_srli_epi64((__m512i)a, 32), factor);
    high = (U)_mm512_mask_blend_epi32(0xAAAA, _mm512_srli_epi64(even, 32), odd);
    low = (U)_mm512_mask_blend_epi32(0xAAAA, even, _mm512_slli_epi64(odd, 32));
#elif defined(BOOTH_LANES_AVX2)
    const __m256i factor = _mm256_set1_epi32(static_cast<int>(m));
    const __m256i even = _mm256_mul_epu32((__m256i)a, factor), odd = _mm256_mul_epu32(_mm256_srli_epi64((__m256i)a, 32), factor);
    high = (U)_mm256_blend_epi32(_mm256_srli_epi64(even, 32), odd, 0xAA);
    low = (U)_mm256_blend_epi32(even, _mm256_slli_epi64(odd, 32), 0xAA);
#elif defined(BOOTH_LANES_SSE2)
    const __m128i factor = _mm_set1_epi32(static_cast<int>(m)), lower = _mm_set1_epi64x(0xFFFFFFFF);
    const __m128i even = _mm_mul_epu32((__m128i)a, factor), odd = _mm_mul_epu32(_mm_srli_epi64((__m128i)a, 32), factor);
    high = (U)_mm_or_si128(_mm_srli_epi64(even, 32), _mm_andnot_si128(lower, odd));
    low = (U)_mm_or_si128(_mm_and_si128(even, lower), _mm_slli_epi64(odd, 32));
#else
    for (int l = 0; l < kLanes; ++l) {
      const std::uint64_t product = static_cast<std::uint64_t>(a[l]) * m;
      high[l] = static_cast<std::uint32_t>(product >> 32), low[l] = static_cast<std::uint32_t>(product);
    }
#endif
  }
};

}  // namespace
}  // namespace booth::fit

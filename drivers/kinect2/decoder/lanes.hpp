// A vector of floats as wide as the processor that this file is compiled for has them: what the decoder needs of it, and no more.
#pragma once

#include <cstddef>
#include <cstdint>

#if defined(__x86_64__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

// Everything has internal linkage: the same names are compiled for several instruction sets and must never meet in the linker. Plain arithmetic is written with
// operators, which compilers know for these types. Roots and quotients are the exact ones: approximations differ from maker to maker, and with them the depth.
namespace {

/// The answer to decoder/phase_maths.hpp; decoder/one_lane.hpp is the one for a single number.
struct VectorLanes {
#if defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512VL__) && defined(__AVX512DQ__)

  static constexpr int kLanes = 16;
  using F = __m512;
  using M = __mmask16;
  using Codes = __m256i;  ///< kLanes codes of 16 bits
  static F load(const float* p) { return _mm512_loadu_ps(p); }
  static void store(float* p, F v) { _mm512_storeu_ps(p, v); }
  static F all(float v) { return _mm512_set1_ps(v); }
  static F least(F a, F b) { return _mm512_min_ps(a, b); }
  static F most(F a, F b) { return _mm512_max_ps(a, b); }
  static F root(F a) { return _mm512_sqrt_ps(a); }
  static F down(F a) { return _mm512_roundscale_ps(a, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC); }
  static F magnitude(F a) { return _mm512_abs_ps(a); }
  static M at_least(F a, F b) { return _mm512_cmp_ps_mask(a, b, _CMP_GE_OQ); }
  static M above(F a, F b) { return _mm512_cmp_ps_mask(a, b, _CMP_GT_OQ); }
  static M both(M a, M b) { return static_cast<M>(a & b); }
  static M but_not(M a, M b) { return static_cast<M>(a & ~b); }
  static bool any(M m) { return m != 0; }
  static F select(M m, F yes, F no) { return _mm512_mask_blend_ps(m, no, yes); }
  static F keep(M m, F a) { return _mm512_maskz_mov_ps(m, a); }
  static Codes load_codes(const std::uint16_t* p) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)); }
  static M is_code(Codes c, std::uint16_t code) { return _mm256_cmpeq_epi16_mask(c, _mm256_set1_epi16(static_cast<short>(code))); }
  static F halves(Codes c) { return _mm512_cvtph_ps(c); }

#elif defined(__AVX2__) && defined(__FMA__) && defined(__F16C__)

  static constexpr int kLanes = 8;
  using F = __m256;
  using M = __m256;
  using Codes = __m128i;
  static F load(const float* p) { return _mm256_loadu_ps(p); }
  static void store(float* p, F v) { _mm256_storeu_ps(p, v); }
  static F all(float v) { return _mm256_set1_ps(v); }
  static F least(F a, F b) { return _mm256_min_ps(a, b); }
  static F most(F a, F b) { return _mm256_max_ps(a, b); }
  static F root(F a) { return _mm256_sqrt_ps(a); }
  static F down(F a) { return _mm256_floor_ps(a); }
  static F magnitude(F a) { return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), a); }
  static M at_least(F a, F b) { return _mm256_cmp_ps(a, b, _CMP_GE_OQ); }
  static M above(F a, F b) { return _mm256_cmp_ps(a, b, _CMP_GT_OQ); }
  static M both(M a, M b) { return _mm256_and_ps(a, b); }
  static M but_not(M a, M b) { return _mm256_andnot_ps(b, a); }
  static bool any(M m) { return _mm256_movemask_ps(m) != 0; }
  static F select(M m, F yes, F no) { return _mm256_blendv_ps(no, yes, m); }
  static F keep(M m, F a) { return _mm256_and_ps(m, a); }
  static Codes load_codes(const std::uint16_t* p) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(p)); }
  static M is_code(Codes c, std::uint16_t code) {
    return _mm256_castsi256_ps(_mm256_cvtepi16_epi32(_mm_cmpeq_epi16(c, _mm_set1_epi16(static_cast<short>(code)))));
  }
  static F halves(Codes c) { return _mm256_cvtph_ps(c); }

#elif defined(__SSE2__)

  static constexpr int kLanes = 4;
  using F = __m128;
  using M = __m128;
  using Codes = __m128i;  ///< of 32 bits here
  static F load(const float* p) { return _mm_loadu_ps(p); }
  static void store(float* p, F v) { _mm_storeu_ps(p, v); }
  static F all(float v) { return _mm_set1_ps(v); }
  static F least(F a, F b) { return _mm_min_ps(a, b); }
  static F most(F a, F b) { return _mm_max_ps(a, b); }
  static F root(F a) { return _mm_sqrt_ps(a); }
  static F down(F a) {
    const F t = _mm_cvtepi32_ps(_mm_cvttps_epi32(a));
    return _mm_sub_ps(t, _mm_and_ps(_mm_cmpgt_ps(t, a), _mm_set1_ps(1)));
  }
  static F magnitude(F a) { return _mm_andnot_ps(_mm_set1_ps(-0.0f), a); }
  static M at_least(F a, F b) { return _mm_cmpge_ps(a, b); }
  static M above(F a, F b) { return _mm_cmpgt_ps(a, b); }
  static M both(M a, M b) { return _mm_and_ps(a, b); }
  static M but_not(M a, M b) { return _mm_andnot_ps(b, a); }
  static bool any(M m) { return _mm_movemask_ps(m) != 0; }
  static F select(M m, F yes, F no) { return _mm_or_ps(_mm_and_ps(m, yes), _mm_andnot_ps(m, no)); }
  static F keep(M m, F a) { return _mm_and_ps(m, a); }
  static Codes load_codes(const std::uint16_t* p) { return _mm_unpacklo_epi16(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p)), _mm_setzero_si128()); }
  static M is_code(Codes c, std::uint16_t code) { return _mm_castsi128_ps(_mm_cmpeq_epi32(c, _mm_set1_epi32(code))); }
  /// Sixteen-bit floats, widened by hand: the exponent is moved up beyond reach of slow denormals and brought back by the difference of two normal numbers.
  static F halves(Codes c) {
    const __m128i body = _mm_slli_epi32(_mm_and_si128(c, _mm_set1_epi32(0x7FFF)), 13), bias = _mm_set1_epi32(112 << 23), one = _mm_set1_epi32(113 << 23);
    const F normal = _mm_castsi128_ps(_mm_add_epi32(body, bias));
    const F tiny = _mm_sub_ps(_mm_castsi128_ps(_mm_add_epi32(body, one)), _mm_castsi128_ps(one));
    const M is_tiny = _mm_castsi128_ps(_mm_cmplt_epi32(body, _mm_set1_epi32(1 << 23)));
    return _mm_or_ps(select(is_tiny, tiny, normal), _mm_castsi128_ps(_mm_slli_epi32(_mm_and_si128(c, _mm_set1_epi32(0x8000)), 16)));
  }

#elif defined(__aarch64__)

  static constexpr int kLanes = 4;
  using F = float32x4_t;
  using M = uint32x4_t;
  using Codes = uint16x4_t;
  static F load(const float* p) { return vld1q_f32(p); }
  static void store(float* p, F v) { vst1q_f32(p, v); }
  static F all(float v) { return vdupq_n_f32(v); }
  static F least(F a, F b) { return vminq_f32(a, b); }
  static F most(F a, F b) { return vmaxq_f32(a, b); }
  static F root(F a) { return vsqrtq_f32(a); }
  static F down(F a) { return vrndmq_f32(a); }
  static F magnitude(F a) { return vabsq_f32(a); }
  static M at_least(F a, F b) { return vcgeq_f32(a, b); }
  static M above(F a, F b) { return vcgtq_f32(a, b); }
  static M both(M a, M b) { return vandq_u32(a, b); }
  static M but_not(M a, M b) { return vbicq_u32(a, b); }
  static bool any(M m) { return vmaxvq_u32(m) != 0; }
  static F select(M m, F yes, F no) { return vbslq_f32(m, yes, no); }
  static F keep(M m, F a) { return vreinterpretq_f32_u32(vandq_u32(m, vreinterpretq_u32_f32(a))); }
  static Codes load_codes(const std::uint16_t* p) { return vld1_u16(p); }
  static M is_code(Codes c, std::uint16_t code) { return vreinterpretq_u32_s32(vmovl_s16(vreinterpret_s16_u16(vceq_u16(c, vdup_n_u16(code))))); }
  static F halves(Codes c) { return vcvt_f32_f16(vreinterpret_f16_u16(c)); }

#else
#error "no vectors for this processor: write its part of lanes.hpp"
#endif

  using I = std::int32_t __attribute__((vector_size(4 * kLanes)));
  static M either(M a, M b) {
#if defined(__x86_64__) && !defined(__AVX512F__)
    return (M)((I)a | (I)b);
#else
    return static_cast<M>(a | b);
#endif
  }
  /// The 11-bit code is a small float: sign, three bits of exponent, seven of mantissa. As a float of sixteen bits it is 2^21 times too small.
  static F values(Codes c) {
#if defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
    return halves(_mm256_or_si256(_mm256_and_si256(_mm256_slli_epi16(c, 3), _mm256_set1_epi16(0x1FF8)),
                                  _mm256_and_si256(_mm256_slli_epi16(c, 5), _mm256_set1_epi16(static_cast<short>(0x8000)))));
#elif defined(__AVX2__) && defined(__FMA__) && defined(__F16C__)
    return halves(_mm_or_si128(_mm_and_si128(_mm_slli_epi16(c, 3), _mm_set1_epi16(0x1FF8)),
                               _mm_and_si128(_mm_slli_epi16(c, 5), _mm_set1_epi16(static_cast<short>(0x8000)))));
#elif defined(__SSE2__)
    return halves(_mm_or_si128(_mm_and_si128(_mm_slli_epi32(c, 3), _mm_set1_epi32(0x1FF8)), _mm_and_si128(_mm_slli_epi32(c, 5), _mm_set1_epi32(0x8000))));
#else
    return halves(vorr_u16(vand_u16(vshl_n_u16(c, 3), vdup_n_u16(0x1FF8)), vand_u16(vshl_n_u16(c, 5), vdup_n_u16(0x8000))));
#endif
  }
  static I whole(F a) { return __builtin_convertvector(a, I); }
  static F shift_exponent(F a, I by) { return (F)((I)a + (by << 23)); }
  static I bits(F a) { return (I)a; }
  static F from_bits(I a) { return (F)a; }
  static F number(I a) { return __builtin_convertvector(a, F); }
};

}  // namespace

// One packed row of 512 codes to 16 bits each, in the order of columns; with byte shuffles where the processor has them.
#pragma once

#include <cstdint>
#include <cstring>

#include "drivers/kinect2/decoder/lanes.hpp"

namespace {

// Column c is slot c / 4 of stripe c % 4; a stripe is 128 codes, 176 bytes. Eight codes are eleven bytes, so that groups of 32 columns begin on whole bytes.
constexpr int kStripeBytes = 176, kGroups = 16, kGroupBytes = 11;

#if defined(__AVX2__)

/// May read up to five bytes beyond the row's end: an image always follows the ones that are decoded.
[[maybe_unused]] void unpack_row(const unsigned char* row, std::uint16_t* codes) {
  const __m256i first = _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 2, -1, 1, 2, 3, -1, 2, 3, 4, -1, 4, 5, 6, -1));
  const __m256i second = _mm256_broadcastsi128_si256(_mm_setr_epi8(5, 6, 7, -1, 6, 7, 8, -1, 8, 9, 10, -1, 9, 10, 11, -1));
  const __m256i first_shift = _mm256_broadcastsi128_si256(_mm_setr_epi32(0, 3, 6, 1)), second_shift = _mm256_broadcastsi128_si256(_mm_setr_epi32(4, 7, 2, 5));
  const __m256i eleven = _mm256_set1_epi32(0x7FF);
  const auto stripes = [&](const unsigned char* low, const unsigned char* high) {  // eight codes of two stripes, one in each half
    const __m256i bytes = _mm256_inserti128_si256(_mm256_castsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(low))),
                                                  _mm_loadu_si128(reinterpret_cast<const __m128i*>(high)), 1);
    const __m256i a = _mm256_and_si256(_mm256_srlv_epi32(_mm256_shuffle_epi8(bytes, first), first_shift), eleven);
    const __m256i b = _mm256_and_si256(_mm256_srlv_epi32(_mm256_shuffle_epi8(bytes, second), second_shift), eleven);
    return _mm256_packus_epi32(a, b);
  };
  const auto in_order = [](__m256i pairs) { return _mm256_shuffle_epi32(_mm256_permute4x64_epi64(pairs, 0xD8), 0xD8); };
  for (int g = 0; g < kGroups; ++g) {
    const unsigned char* p = row + g * kGroupBytes;
    const __m256i even = stripes(p, p + 2 * kStripeBytes), odd = stripes(p + kStripeBytes, p + 3 * kStripeBytes);
    auto* out = reinterpret_cast<__m256i*>(codes + 32 * g);
    _mm256_storeu_si256(out, in_order(_mm256_unpacklo_epi16(even, odd)));
    _mm256_storeu_si256(out + 1, in_order(_mm256_unpackhi_epi16(even, odd)));
  }
}

#elif defined(__aarch64__)

/// May read up to five bytes beyond the row's end: an image always follows the ones that are decoded.
[[maybe_unused]] void unpack_row(const unsigned char* row, std::uint16_t* codes) {
  static constexpr std::uint8_t kFirst[16]{0, 1, 2, 255, 1, 2, 3, 255, 2, 3, 4, 255, 4, 5, 6, 255},
      kSecond[16]{5, 6, 7, 255, 6, 7, 8, 255, 8, 9, 10, 255, 9, 10, 11, 255};
  static constexpr std::int32_t kFirstShift[4]{0, -3, -6, -1}, kSecondShift[4]{-4, -7, -2, -5};
  const uint8x16_t first = vld1q_u8(kFirst), second = vld1q_u8(kSecond);
  const int32x4_t first_shift = vld1q_s32(kFirstShift), second_shift = vld1q_s32(kSecondShift);
  const auto stripe = [&](const unsigned char* p) {
    const uint8x16_t bytes = vld1q_u8(p);
    const uint32x4_t a = vshlq_u32(vreinterpretq_u32_u8(vqtbl1q_u8(bytes, first)), first_shift);
    const uint32x4_t b = vshlq_u32(vreinterpretq_u32_u8(vqtbl1q_u8(bytes, second)), second_shift);
    return vandq_u16(vcombine_u16(vmovn_u32(a), vmovn_u32(b)), vdupq_n_u16(0x7FF));
  };
  for (int g = 0; g < kGroups; ++g) {
    const unsigned char* p = row + g * kGroupBytes;
    vst4q_u16(codes + 32 * g, (uint16x8x4_t{{stripe(p), stripe(p + kStripeBytes), stripe(p + 2 * kStripeBytes), stripe(p + 3 * kStripeBytes)}}));
  }
}

#else

[[maybe_unused]] void unpack_row(const unsigned char* row, std::uint16_t* codes) {
  for (int stripe = 0; stripe < 4; ++stripe)
    for (int g = 0; g < kGroups; ++g) {
      const unsigned char* p = row + stripe * kStripeBytes + g * kGroupBytes;
      std::uint64_t low, high;
      std::memcpy(&low, p, 8);
      std::memcpy(&high, p + 3, 8);
      std::uint16_t* out = codes + 32 * g + stripe;
      for (int k = 0; k < 5; ++k) out[4 * k] = static_cast<std::uint16_t>(low >> (11 * k) & 0x7FF);
      for (int k = 5; k < 8; ++k) out[4 * k] = static_cast<std::uint16_t>(high >> (11 * k - 24) & 0x7FF);
    }
}

#endif

}  // namespace

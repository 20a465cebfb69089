// Twelve independent chains hide the latency of every processor known to us.
#include "tests/bench/swarm/peak.hpp"

#include "tests/bench/harness/harness.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace booth::bench {

#if defined(__x86_64__)
namespace {

constexpr int kChains = 12, kRounds = 20000;
volatile float sink;

__attribute__((target("avx512f"))) void chains_avx512() {
  __m512 a[kChains], m = _mm512_set1_ps(0.999f), s = _mm512_set1_ps(0.001f);
  for (auto& x : a) x = s;
  for (int r = 0; r < kRounds; ++r) {
#pragma GCC unroll 12
    for (int c = 0; c < kChains; ++c) a[c] = _mm512_fmadd_ps(a[c], m, s);
  }
  float out[16], sum = 0;
  for (auto x : a) _mm512_storeu_ps(out, x), sum += out[0];
  sink = sum;
}

__attribute__((target("avx2,fma"))) void chains_avx2() {
  __m256 a[kChains], m = _mm256_set1_ps(0.999f), s = _mm256_set1_ps(0.001f);
  for (auto& x : a) x = s;
  for (int r = 0; r < kRounds; ++r) {
#pragma GCC unroll 12
    for (int c = 0; c < kChains; ++c) a[c] = _mm256_fmadd_ps(a[c], m, s);
  }
  float out[8], sum = 0;
  for (auto x : a) _mm256_storeu_ps(out, x), sum += out[0];
  sink = sum;
}

void chains_baseline() {
  __m128 a[kChains], m = _mm_set1_ps(0.999f), s = _mm_set1_ps(0.001f);
  for (auto& x : a) x = s;
  for (int r = 0; r < kRounds; ++r) {
#pragma GCC unroll 12
    for (int c = 0; c < kChains; ++c) a[c] = _mm_add_ps(_mm_mul_ps(a[c], m), s);
  }
  float out[4], sum = 0;
  for (auto x : a) _mm_storeu_ps(out, x), sum += out[0];
  sink = sum;
}

}  // namespace

double peak_multiply_adds(std::string_view kernel) {
  const double chains = static_cast<double>(kChains) * kRounds;
  if (kernel == "avx512" && __builtin_cpu_supports("avx512f")) return 16 * chains / median_seconds(25, [] { chains_avx512(); });
  if (kernel == "avx2" && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return 8 * chains / median_seconds(25, [] { chains_avx2(); });
  if (kernel == "baseline") return 4 * chains / median_seconds(25, [] { chains_baseline(); });
  return 0;
}
#else
double peak_multiply_adds(std::string_view) { return 0; }
#endif

}  // namespace booth::bench

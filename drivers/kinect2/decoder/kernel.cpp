// The decoder as loops over rows that a compiler turns into vectors; compiled once for each instruction set, without a branch in an inner loop.
#include <cstdint>
#include <cstring>

#include "drivers/kinect2/decoder/kernels.hpp"

#ifndef BOOTH_DECODE
#error "BOOTH_DECODE must name the function, e.g. decode_avx2"
#endif

namespace booth::drivers::kinect2 {
namespace {

constexpr int W = 512, H = 424, kRow = 704, kImage = W * H * 11 / 8, kSaturatedValue = 32767;
constexpr float kPi = 3.14159265f, kAmplitude = 0.6666667f;

float root(float x) { return __builtin_sqrtf(x); }
float least(float a, float b) { return a < b ? a : b; }
float most(float a, float b) { return a > b ? a : b; }
float down(float x) {
  const float t = static_cast<float>(static_cast<std::int32_t>(x));
  return t - (t > x ? 1.0f : 0.0f);
}

/// 512 codes of 11 bits, in the order of the wire, to values in the order of columns.
void unpack(const unsigned char* row, std::uint16_t* packed, float* value) {
  for (int g = 0; g < W / 8; ++g) {
    std::uint64_t low, high;
    std::memcpy(&low, row + 11 * g, 8);
    std::memcpy(&high, row + 11 * g + 3, 8);
    std::uint16_t* out = packed + 8 * g;
    for (int k = 0; k < 5; ++k) out[k] = static_cast<std::uint16_t>(low >> (11 * k) & 0x7FF);
    for (int k = 5; k < 8; ++k) out[k] = static_cast<std::uint16_t>(high >> (11 * k - 24) & 0x7FF);
  }
  for (int k = 0; k < W / 4; ++k)
    for (int stripe = 0; stripe < 4; ++stripe) {
      const std::int32_t code = packed[128 * stripe + k], i = code & 1023, segment = i >> 7;
      const std::int32_t magnitude = segment == 0 ? i : (128 + (i & 127)) << (segment - (segment > 0));
      const std::int32_t signed_value = code > 1024 ? -magnitude : magnitude;
      value[4 * k + stripe] = static_cast<float>(code == 1024 ? kSaturatedValue : signed_value);
    }
  value[0] = value[W - 1] = 0;  // the outer columns carry no measurement
}

/// Phase vectors of one output row, and its infrared.
void measure(const KernelWork& w, const unsigned char* images, int r) {
  const int raw = r < 212 ? r : 635 - r;
  const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(r) * W;
  for (int i = 0; i < 9; ++i) unpack(images + static_cast<std::ptrdiff_t>(i) * kImage + static_cast<std::ptrdiff_t>(raw) * kRow, w.packed, w.value[i]);
  for (int x = 0; x < W; ++x) w.infrared[x] = 0;
  for (int f = 0; f < 3; ++f) {
    const float *m0 = w.value[3 * f], *m1 = w.value[3 * f + 1], *m2 = w.value[3 * f + 2], *cp = w.cos_p[f] + at, *sp = w.sin_p[f] + at;
    float *a = w.a[f] + at, *b = w.b[f] + at, *ua = w.unit_a[f] + at, *ub = w.unit_b[f] + at;
    float* infrared = w.infrared;
#pragma GCC ivdep
    for (int x = 0; x < W; ++x) {
      const bool saturated = (m0[x] == kSaturatedValue) | (m1[x] == kSaturatedValue) | (m2[x] == kSaturatedValue);
      const float real = m0[x] - 0.5f * (m1[x] + m2[x]), imaginary = 0.8660254f * (m2[x] - m1[x]);
      // sum m_k cos(p + theta_k) = A cos p + B sin p with A = real and B = sqrt(3)/2 (m2 - m1); likewise for the sine.
      const float va = real * cp[x] + imaginary * sp[x], vb = imaginary * cp[x] - real * sp[x];
      const float na = saturated ? 0.0f : va, nb = saturated ? 0.0f : vb;
      const float n = root(na * na + nb * nb), inverse = n > 0 ? 1.0f / most(n, 1e-20f) : 0.0f;
      a[x] = na;
      b[x] = nb;
      ua[x] = na * inverse;
      ub[x] = nb * inverse;
      infrared[x] += saturated ? 65535.0f : kAmplitude * n;
    }
  }
}

/// exp(-t) for t from 0 to 10, by the eighth power of a polynomial; relative error below 1e-5.
float decay(float t) {
  const float x = -0.125f * t;
  float e = 1.0f + x * (1.0f + x * (0.5f + x * (0.16666667f + x * (0.041666667f + x * (0.008333333f + x * 0.0013888889f)))));
  e *= e;
  e *= e;
  return e * e;
}

/// Turns in [0, 1); error below 1e-5 of a turn.
float turn(float b, float a) {
  const float absolute_a = __builtin_fabsf(a), absolute_b = __builtin_fabsf(b);
  const float high = most(absolute_a, absolute_b), low = least(absolute_a, absolute_b);
  const float t = low / most(high, 1e-20f), t2 = t * t;
  // Abramowitz and Stegun 4.4.49.
  float angle =
      t *
      (1.0f +
       t2 * (-0.3333314528f +
             t2 * (0.1999355085f +
                   t2 * (-0.1420889944f + t2 * (0.1065626393f + t2 * (-0.0752896400f + t2 * (0.0429096138f + t2 * (-0.0161657367f + t2 * 0.0028662257f))))))));
  angle = absolute_b > absolute_a ? 0.5f * kPi - angle : angle;
  angle = a < 0 ? kPi - angle : angle;
  const float q = (b < 0 ? -angle : angle) * (0.5f / kPi);
  return q < 0 ? q + 1.0f : q;
}

/// The filtered vector of frequency f along row r goes to `fa`, `fb`; ok is lowered where too many neighbours disagree.
void smooth(const KernelWork& w, int f, int r, float* fa, float* fb, float* ok) {
  const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(r) * W;
  const float *a = w.a[f] + at, *b = w.b[f] + at, *ua = w.unit_a[f] + at, *ub = w.unit_b[f] + at;
  const float exponent = w.exponent;
#pragma GCC ivdep
  for (int x = 1; x < W - 1; ++x) {
    const float n2 = a[x] * a[x] + b[x] * b[x];
    const float limit = n2 < 20.25f ? 1e-30f : 20.25f, strength = n2 < 20.25f ? 0.0f : exponent;
    float weight = 0.1195716f, sa = weight * a[x], sb = weight * b[x], distance = 0;
    const auto add = [&](std::ptrdiff_t q, float gauss) {
      const float q2 = a[q] * a[q] + b[q] * b[q];
      const float use = q2 >= limit ? 1.0f : 0.0f;
      const float d = most(0.5f - 0.5f * (ua[x] * ua[q] + ub[x] * ub[q]), 0.0f);
      const float g = use * gauss * decay(strength * d);
      weight += g;
      sa += g * a[q];
      sb += g * b[q];
      distance += use * d;
    };
    add(x - W - 1, 0.1069973f);
    add(x - W, 0.1131098f);
    add(x - W + 1, 0.1069973f);
    add(x - 1, 0.1131098f);
    add(x + 1, 0.1131098f);
    add(x + W - 1, 0.1069973f);
    add(x + W, 0.1131098f);
    add(x + W + 1, 0.1069973f);
    const float inverse = 1.0f / weight;
    const bool dark = n2 == 0;
    fa[x] = dark ? 0.0f : sa * inverse;
    fb[x] = dark ? 0.0f : sb * inverse;
    ok[x] = dark | (distance >= 2.5f) ? 0.0f : ok[x];
  }
}

/// Range in millimetres along z and amplitude sum of row r, from the filtered vectors.
void unwrap(const KernelWork& w, int r, const float* const* fa, const float* const* fb) {
  const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(r) * W;
  const float *xu = w.xu + at, *s = w.s + at, *a0 = fa[0], *a1 = fa[1], *a2 = fa[2], *b0 = fb[0], *b1 = fb[1], *b2 = fb[2];
  float *sum = w.sum + at, *range = w.range + at;
  const float scale = w.residual_scale;
#pragma GCC ivdep
  for (int x = 0; x < W; ++x) {
    const float n0 = kAmplitude * root(a0[x] * a0[x] + b0[x] * b0[x]), n1 = kAmplitude * root(a1[x] * a1[x] + b1[x] * b1[x]),
                n2 = kAmplitude * root(a2[x] * a2[x] + b2[x] * b2[x]);
    const float total = n0 + n1 + n2, lowest = least(n0, least(n1, n2)), highest = most(n0, most(n1, n2));
    const float u0 = 3 * turn(b0[x], a0[x]), u1 = 15 * turn(b1[x], a1[x]), u2 = 2 * turn(b2[x], a2[x]);
    float u = u0 + 3 * down((u1 - u0) * (1.0f / 3) + 0.5f);
    const float apart = __builtin_fabsf(u - u2), e = apart - 2 * down(0.5f * apart);
    const float half = (e > 0.5f) & (e < 1.5f) ? 15.0f : 0.0f;
    u += half;
    const float v1 = u1 + half, v2 = u2 + 2 * down(0.5f * (u - u2) + 0.5f);
    const float c0 = u * (1.0f / 3), c1 = v1 * (1.0f / 15), c2 = 0.5f * v2, mean = (c0 + c1 + c2) * (1.0f / 3);
    const float h0 = 0.551317818f, h1 = 0.110263564f, h2 = 0.826976727f;
    const float rx = h1 * c2 - h2 * c1, ry = h2 * c0 - h0 * c2, rz = h0 * c1 - h1 * c0, residual = rx * rx + ry * ry + rz * rz;
    // The limit's square goes with n^-1.0661: n^-1, n^-1/16 by roots, and the rest by a line that is right to 2e-4 where the clamp does not decide (n 70 to
    // 871).
    const float n = most(highest, 1.0f), sixteenth = root(root(root(root(n))));
    const float power = 1.0f / (n * sixteenth * (0.961f + 0.041776f * sixteenth));
    const float limit = least(most(scale * power, 0.0030864198f), 0.0094521606f);
    const float d = mean * (2 * 2083.3333f), denominator = 2 * d * s[x] - 90.0f * xu[x];
    const bool good = (lowest >= 3.0f) & (total >= 10.0f) & (mean >= 0) & (residual <= limit) & (s[x] > 0) & (denominator > 0);
    sum[x] = total;
    range[x] = good ? d * d / most(denominator, 1e-6f) : 0.0f;
  }
}

void accept_border(const KernelWork& w, int r, int x) {
  const std::ptrdiff_t i = static_cast<std::ptrdiff_t>(r) * W + x;
  const float z = w.range[i];
  w.depth[i] = z >= w.minimum && z <= w.maximum && w.ok[i] > 0 ? z : 0;
}

void accept(const KernelWork& w, int r) {
  const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(r) * W;
  if (!w.edge || r == 0 || r == H - 1) {
    for (int x = 0; x < W; ++x) accept_border(w, r, x);
    return;
  }
  accept_border(w, r, 0);
  accept_border(w, r, W - 1);
  const float *range = w.range + at, *ok = w.ok + at, *amplitude = w.sum + at;
  float* depth = w.depth + at;
  const float minimum = w.minimum, maximum = w.maximum;
#pragma GCC ivdep
  for (int x = 1; x < W - 1; ++x) {
    const float z = range[x];
    float total = 0, low = z, high = z;
    const auto look = [&](std::ptrdiff_t q) {
      total += amplitude[q];
      const bool there = (range[q] > 0) & (ok[q] > 0);
      low = least(low, there ? range[q] : low);
      high = most(high, there ? range[q] : high);
    };
    look(x - W - 1), look(x - W), look(x - W + 1), look(x - 1), look(x), look(x + 1), look(x + W - 1), look(x + W), look(x + W + 1);
    const float mean = total * (1.0f / 9);
    float squares = 0;  // of the differences from the mean: the textbook difference of sums loses all digits in single precision
    const auto spread = [&](std::ptrdiff_t q) {
      const float e = amplitude[q] - mean;
      squares += e * e;
    };
    spread(x - W - 1), spread(x - W), spread(x - W + 1), spread(x - 1), spread(x), spread(x + 1), spread(x + W - 1), spread(x + W), spread(x + W + 1);
    const float deviation = root(squares * (1.0f / 9));
    const bool edge = (deviation >= 0.05f * most(mean, 50.0f)) & (z - low > 50.0f) & (high - z > 30.0f) & (most(z - low, high - z) > 100.0f);
    depth[x] = (z >= minimum) & (z <= maximum) & (ok[x] > 0) & !edge ? z : 0.0f;
  }
}

void filter_and_unwrap(const KernelWork& w, int r) {
  const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(r) * W;
  float filtered[6][W];
  const float *fa[3], *fb[3];
  float* ok = w.ok + at;
  for (int x = 0; x < W; ++x) ok[x] = 1.0f;
  for (int f = 0; f < 3; ++f) {
    fa[f] = w.a[f] + at;
    fb[f] = w.b[f] + at;
    if (!w.bilateral || r == 0 || r == H - 1) continue;
    float *pa = filtered[2 * f], *pb = filtered[2 * f + 1];
    pa[0] = fa[f][0], pb[0] = fb[f][0], pa[W - 1] = fa[f][W - 1], pb[W - 1] = fb[f][W - 1];
    smooth(w, f, r, pa, pb, ok);
    fa[f] = pa;
    fb[f] = pb;
  }
  unwrap(w, r, fa, fb);
}

void write_row(const KernelWork& w, int r, std::uint16_t* out) {
  const float* depth = w.depth + static_cast<std::ptrdiff_t>(r) * W;
  std::uint16_t* row = out + static_cast<std::ptrdiff_t>(r) * W;
#pragma GCC ivdep
  for (int x = 0; x < W; ++x) row[W - 1 - x] = static_cast<std::uint16_t>(static_cast<std::int32_t>(depth[x] + 0.5f));
}

}  // namespace

void BOOTH_DECODE(const KernelWork& w, const unsigned char* images, std::uint16_t* depth, std::uint16_t* infrared) {
  // Each stage runs a row behind the one before, so that the rows it looks at are still in the cache.
  for (int r = 0; r < H + 3; ++r) {
    if (r < H) {
      measure(w, images, r);
      if (infrared != nullptr)
        for (int x = 0; x < W; ++x)
          infrared[static_cast<std::ptrdiff_t>(r) * W + W - 1 - x] =
              static_cast<std::uint16_t>(static_cast<std::int32_t>(least(65535.0f, w.infrared[x] * (16.0f / 3)) + 0.5f));
    }
    if (r >= 1 && r - 1 < H) filter_and_unwrap(w, r - 1);
    if (r >= 2 && r - 2 < H && r - 2 >= 0) {
      accept(w, r - 2);
      write_row(w, r - 2, depth);
    }
  }
}

}  // namespace booth::drivers::kinect2

// The decoder in vectors, a few rows at a time so that nothing leaves the nearest caches; compiled once for each instruction set.
#include <cstdint>

#include "drivers/kinect2/decoder/kernels.hpp"
#include "drivers/kinect2/decoder/lanes.hpp"
#include "drivers/kinect2/decoder/unpack.hpp"

#ifndef BOOTH_DECODE
#error "BOOTH_DECODE must name the function, e.g. decode_avx2"
#endif

namespace booth::drivers::kinect2 {
namespace {

constexpr int W = 512, H = 424;
constexpr std::ptrdiff_t kRow = 704, kImage = kRow * H;
constexpr float kAmplitude = 0.6666667f, kWeak = 4.5f, kTiny = 1e-20f;
constexpr float kGaussCorner = 0.1069973f, kGaussSide = 0.1131098f, kGaussCentre = 0.1195716f;

std::ptrdiff_t ring(int r) { return r % kRingRows * kRowFloats; }

/// The code is a small float: sign, three bits of exponent, seven of mantissa. As a float of sixteen bits it is 2^21 times too small.
F values(Codes c) {
#if defined(__AVX512F__)
  return halves(_mm256_or_si256(_mm256_and_si256(_mm256_slli_epi16(c, 3), _mm256_set1_epi16(0x1FF8)),
                                _mm256_and_si256(_mm256_slli_epi16(c, 5), _mm256_set1_epi16(static_cast<short>(0x8000)))));
#elif defined(__AVX2__)
  return halves(_mm_or_si128(_mm_and_si128(_mm_slli_epi16(c, 3), _mm_set1_epi16(0x1FF8)),
                             _mm_and_si128(_mm_slli_epi16(c, 5), _mm_set1_epi16(static_cast<short>(0x8000)))));
#elif defined(__SSE2__)
  return halves(_mm_or_si128(_mm_and_si128(_mm_slli_epi32(c, 3), _mm_set1_epi32(0x1FF8)), _mm_and_si128(_mm_slli_epi32(c, 5), _mm_set1_epi32(0x8000))));
#else
  return halves(vorr_u16(vand_u16(vshl_n_u16(c, 3), vdup_n_u16(0x1FF8)), vand_u16(vshl_n_u16(c, 5), vdup_n_u16(0x8000))));
#endif
}

/// Phase vectors of one output row, as length and direction, and its infrared.
void measure(const KernelWork& w, const unsigned char* images, int r) {
  constexpr float kValue = 2097152.0f;  // 2^21
  const std::ptrdiff_t raw = (r < 212 ? r : 635 - r) * kRow, at = static_cast<std::ptrdiff_t>(r) * W;
  for (int i = 0; i < 9; ++i) {
    std::uint16_t* codes = w.codes + static_cast<std::ptrdiff_t>(i) * W;
    unpack_row(images + i * kImage + raw, codes);
    codes[0] = codes[W - 1] = 0;  // the outer columns carry no measurement
  }
  for (int x = 0; x < W; x += kLanes) {
    F infrared = all(0);
    for (int f = 0; f < 3; ++f) {
      const std::uint16_t* codes = w.codes + static_cast<std::ptrdiff_t>(3 * f) * W + x;
      const Codes c0 = load_codes(codes), c1 = load_codes(codes + W), c2 = load_codes(codes + 2 * W);
      const M saturated = either(is_code(c0, 1024), either(is_code(c1, 1024), is_code(c2, 1024)));
      const F m0 = values(c0), m1 = values(c1), m2 = values(c2);
      // sum m_k cos(p + theta_k) = A cos p + B sin p with A = m0 - (m1 + m2) / 2 and B = sqrt(3) / 2 (m2 - m1); likewise for the sine.
      const F real = m0 * kValue - (m1 + m2) * (0.5f * kValue), imaginary = (m2 - m1) * (0.8660254f * kValue);
      const F cp = load(w.cos_p[f] + at + x), sp = load(w.sin_p[f] + at + x);
      const F a = real * cp + imaginary * sp, b = imaginary * cp - real * sp;
      const F n = root(a * a + b * b), inverse = 1.0f / most(n, all(kTiny));
      const std::ptrdiff_t to = ring(r) + x;
      store(w.length[f] + to, select(saturated, all(0), n));
      store(w.unit_a[f] + to, a * inverse);
      store(w.unit_b[f] + to, b * inverse);
      infrared += select(saturated, all(65535), n * kAmplitude);
    }
    store(w.infrared + x, infrared);
  }
}

struct Smoothed {
  F a, b, weight;  ///< the vector is (a, b) / weight
  M agree;         ///< the neighbours point nearly the same way
};

/// The bilateral filter over 3 x 3 vectors of one frequency; `some_weak`: there are weak or missing vectors among the centres.
template <bool some_weak>
Smoothed smooth(const KernelWork& w, int f, std::ptrdiff_t above_row, std::ptrdiff_t row, std::ptrdiff_t below_row, F n) {
  const F ua = load(w.unit_a[f] + row), ub = load(w.unit_b[f] + row);
  const M weak = above(all(kWeak), n);
  const F limit = some_weak ? select(weak, all(1e-15f), all(kWeak)) : all(kWeak);
  const F centre = n * kGaussCentre;
  F weight = all(kGaussCentre), a = centre * ua, b = centre * ub, distance = all(0);
  const auto add = [&](std::ptrdiff_t q, const float* root8, float gauss) {
    const F qn = load(w.length[f] + q), qa = load(w.unit_a[f] + q), qb = load(w.unit_b[f] + q);
    const F twice = 1.0f - ua * qa - ub * qb;
    F g = root8[0] + twice * (root8[1] + twice * (root8[2] + twice * (root8[3] + twice * root8[4])));
    g *= g, g *= g, g *= g;
    if (some_weak) g = select(weak, all(gauss), g);
    const M use = at_least(qn, limit);
    g = keep(use, g);
    const F gn = g * qn;
    weight += g;
    a += gn * qa;
    b += gn * qb;
    distance += keep(use, twice);
  };
  add(above_row - 1, w.corner, kGaussCorner), add(above_row, w.side, kGaussSide), add(above_row + 1, w.corner, kGaussCorner);
  add(row - 1, w.side, kGaussSide), add(row + 1, w.side, kGaussSide);
  add(below_row - 1, w.corner, kGaussCorner), add(below_row, w.side, kGaussSide), add(below_row + 1, w.corner, kGaussCorner);
  M agree = above(all(5), distance);
  if (some_weak) {
    const M there = above(n, all(0));
    agree = both(agree, there);
    a = keep(there, a), b = keep(there, b);
  }
  return {a, b, weight, agree};
}

struct Polar {
  F amplitude, turn;  ///< turn from 0 to 1
};

Polar polar(F a, F b, F weight) {
  const F absolute_a = magnitude(a), absolute_b = magnitude(b);
  const F high = most(most(absolute_a, absolute_b), all(kTiny)), low = least(absolute_a, absolute_b);
  const F inverse = 1.0f / (high * weight), t = low * (weight * inverse), t2 = t * t;
  // Minimax polynomial of the arc tangent from 0 to 1, in turns; the error is below 4e-7 of a turn.
  F turn = t * (0.15915482f +
                t2 * (-0.0530394639f + t2 * (0.0316273344f + t2 * (-0.0214029404f + t2 * (0.0132299859f + t2 * (-0.0057869423f + t2 * (0.00121727333f)))))));
  turn = select(above(absolute_b, absolute_a), 0.25f - turn, turn);
  turn = select(above(all(0), a), 0.5f - turn, turn);
  turn = select(above(all(0), b), 1.0f - turn, turn);
  return {root(a * a + b * b) * (high * inverse * kAmplitude), turn};
}

/// Square of the residual limit, in turns, before it is clamped: scale n^-1.0661156, by logarithm and power of two.
F residual_limit(F n, float scale) {
  const I raw = bits(most(n, all(1)));
  const F exponent = number((raw >> 23) - 127), m = from_bits((raw & 0x007F'FFFF) | 0x3F80'0000) - 1.0f;
  const F y = (exponent + m * (1.44268147f + m * (-0.720358773f + m * (0.468658879f + m * (-0.30163801f + m * (0.144471096f + m * (-0.033822046f))))))) *
              -1.0661156f,
          whole = down(y), part = y - whole;
  const F power = 1.00000349f + part * (0.692972922f + part * (0.241604357f + part * (0.0517449978f + part * (0.0136703095f))));
  return from_bits(bits(power) + (__builtin_convertvector(whole, I) << 23)) * scale;
}

/// One vector of amplitude sums and ranges, from three phases and amplitudes.
void unwrap(const KernelWork& w, const Polar* p, M agree, std::ptrdiff_t pixel, std::ptrdiff_t to) {
  const F total = p[0].amplitude + p[1].amplitude + p[2].amplitude;
  const F lowest = least(p[0].amplitude, least(p[1].amplitude, p[2].amplitude)), highest = most(p[0].amplitude, most(p[1].amplitude, p[2].amplitude));
  store(w.sum + to, total);
  M good = both(agree, both(at_least(lowest, all(3)), at_least(total, all(10))));
  if (!any(good)) return store(w.range + to, all(0));
  // Base units of 625 mm: periods of 3, 15 and 2.
  const F u0 = p[0].turn * 3.0f, u1 = p[1].turn * 15.0f, u2 = p[2].turn * 2.0f;
  F u = u0 + 3.0f * down((u1 - u0) * (1.0f / 3) + 0.5f);
  const F apart = magnitude(u - u2), e = apart - 2.0f * down(0.5f * apart);
  const F half = keep(both(above(e, all(0.5f)), above(all(1.5f), e)), all(15));
  u += half;
  const F v1 = u1 + half, v2 = u2 + 2.0f * down(0.5f * (u - u2) + 0.5f);
  const F c0 = u * (1.0f / 3), c1 = v1 * (1.0f / 15), c2 = 0.5f * v2, mean = (c0 + c1 + c2) * (1.0f / 3);
  const float h0 = 0.551317818f, h1 = 0.110263564f, h2 = 0.826976727f;
  const F rx = h1 * c2 - h2 * c1, ry = h2 * c0 - h0 * c2, rz = h0 * c1 - h1 * c0, residual = rx * rx + ry * ry + rz * rz;
  const F strictest = all(0.0030864198f), loosest = all(0.0094521606f);  // 20 and 35 degrees, squared, in turns
  F limit = strictest;
  if (any(both(good, above(residual, strictest)))) limit = least(most(residual_limit(highest, w.residual_scale), strictest), loosest);
  const F s = load(w.s + pixel), d = mean * (2 * 2083.3333f), denominator = 2.0f * d * s - 90.0f * load(w.xu + pixel);
  good = both(both(good, at_least(limit, residual)), both(at_least(mean, all(0)), both(above(s, all(0)), above(denominator, all(0)))));
  store(w.range + to, keep(good, d * d / most(denominator, all(1e-6f))));
}

void filter_and_unwrap(const KernelWork& w, int r) {
  const std::ptrdiff_t row = ring(r), above_row = ring(r + kRingRows - 1), below_row = ring(r + 1);
  const bool filter = w.bilateral && r > 0 && r < H - 1;
  for (int x = 0; x < W; x += kLanes) {
    Polar p[3];
    M agree = at_least(all(0), all(0));
    for (int f = 0; f < 3; ++f) {
      const F n = load(w.length[f] + row + x);
      if (!filter) {
        p[f] = polar(n * load(w.unit_a[f] + row + x), n * load(w.unit_b[f] + row + x), all(1));
        continue;
      }
      const Smoothed v = any(above(all(kWeak), n)) ? smooth<true>(w, f, above_row + x, row + x, below_row + x, n)
                                                   : smooth<false>(w, f, above_row + x, row + x, below_row + x, n);
      p[f] = polar(v.a, v.b, v.weight);
      agree = both(agree, v.agree);
    }
    unwrap(w, p, agree, static_cast<std::ptrdiff_t>(r) * W + x, row + x);
  }
}

F within_limits(const KernelWork& w, F z) { return keep(both(at_least(z, all(w.minimum)), at_least(all(w.maximum), z)), z); }

/// The row's depth without what lies on the edge between two surfaces.
void accept(const KernelWork& w, int r) {
  const std::ptrdiff_t row = ring(r), above_row = ring(r + kRingRows - 1), below_row = ring(r + 1);
  float* depth = w.depth + static_cast<std::ptrdiff_t>(r) * W;
  if (!w.edge || r == 0 || r == H - 1) {
    for (int x = 0; x < W; x += kLanes) store(depth + x, within_limits(w, load(w.range + row + x)));
    return;
  }
  for (int x = 0; x < W; x += kLanes) {
    const F s0 = load(w.sum + above_row + x), s1 = load(w.sum + row + x), s2 = load(w.sum + below_row + x);
    store(w.column[0] + x, s0 + s1 + s2);
    store(w.column[1] + x, s0 * s0 + s1 * s1 + s2 * s2);
    const F z0 = load(w.range + above_row + x), z1 = load(w.range + row + x), z2 = load(w.range + below_row + x), nothing = all(0), far = all(1e9f);
    const auto near = [&](F z) { return select(above(z, nothing), z, far); };
    store(w.column[2] + x, least(near(z0), least(near(z1), near(z2))));
    store(w.column[3] + x, most(z0, most(z1, z2)));
  }
  for (int x = 0; x < W; x += kLanes) {
    const F z = within_limits(w, load(w.range + row + x));
    const auto three = [&](int k, auto combine) { return combine(load(w.column[k] + x - 1), combine(load(w.column[k] + x), load(w.column[k] + x + 1))); };
    const auto plus = [](F a, F b) { return a + b; };
    const F total = three(0, plus), squares = three(1, plus), floor = most(total, all(450));
    const F low = z - three(2, [](F a, F b) { return least(a, b); }), high = three(3, [](F a, F b) { return most(a, b); }) - z;
    // 81 times variance against (0.05 * 9)^2 of the mean: rounding is some 1e-4 of what is compared.
    const M uneven = at_least(9.0f * squares - total * total, 0.0025f * floor * floor);
    const M edge = both(both(uneven, above(low, all(50))), both(above(high, all(30)), above(most(low, high), all(100))));
    store(depth + x, select(edge, all(0), z));
  }
}

/// To whole numbers, and from the device's mirrored columns to ours.
void write_row(const float* from, float scale, std::uint16_t* to) {
#pragma GCC ivdep
  for (int x = 0; x < W; ++x) {
    const float v = from[x] * scale;
    to[W - 1 - x] = static_cast<std::uint16_t>(static_cast<std::int32_t>((v < 65535.0f ? v : 65535.0f) + 0.5f));
  }
}

}  // namespace

void BOOTH_DECODE(const KernelWork& w, const unsigned char* images, std::uint16_t* depth, std::uint16_t* infrared) {
  // Each stage runs a row behind the one before.
  for (int r = 0; r < H + 2; ++r) {
    if (r < H) {
      measure(w, images, r);
      if (infrared != nullptr) write_row(w.infrared, 16.0f / 3, infrared + static_cast<std::ptrdiff_t>(r) * W);
    }
    if (r >= 1 && r <= H) filter_and_unwrap(w, r - 1);
    if (r >= 2) {
      accept(w, r - 2);
      write_row(w.depth + static_cast<std::ptrdiff_t>(r - 2) * W, 1, depth + static_cast<std::ptrdiff_t>(r - 2) * W);
    }
  }
}

}  // namespace booth::drivers::kinect2

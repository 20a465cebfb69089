// From measured codes to millimetres, pixel by pixel: the arithmetic that the vectors of every processor and the threads of a graphics processor share.
#pragma once

#include <cstdint>

#include "fit/gpu/host_device.hpp"

namespace booth::drivers::kinect2 {

// L is a set of numbers and what is done with them: decoder/lanes.hpp, decoder/one_lane.hpp. docs/reference/kinect2.md describes the method,
// decoder/reference.cpp is the same in double precision and without tricks.

inline constexpr float kAmplitude = 0.6666667f, kWeak = 4.5f, kTiny = 1e-20f, kSaturatedAmplitude = 65535, kInfraredPerSum = 16.0f / 3;
inline constexpr float kCornerWeight = 0.1069973f, kSideWeight = 0.1131098f, kCentreWeight = 0.1195716f;

/// What the settings make of the formulas.
struct DecodeNumbers {
  float minimum = 500, maximum = 4500;  ///< millimetres
  float corner[5] = {}, side[5] = {};   ///< eighth root of a bilateral weight as a polynomial of twice the distance
  float residual_scale = 1;             ///< square of the residual limit at amplitude one, in turns
  bool bilateral = true, edge = true;
};

/// The phase vector of one frequency as length and direction; length 0: no signal.
template <class L>
struct PhaseVector {
  typename L::F length, a, b, infrared;  ///< infrared: what it adds to the picture
};

/// From three codes, and the cosine and sine of the pixel's phase offset times the frequency's gain.
template <class L>
BOOTH_HOST_DEVICE PhaseVector<L> measure_phase(typename L::Codes c0, typename L::Codes c1, typename L::Codes c2, typename L::F cosine, typename L::F sine) {
  using F = typename L::F;
  constexpr float kValue = 2097152.0f;  // 2^21
  const auto saturated = L::either(L::is_code(c0, 1024), L::either(L::is_code(c1, 1024), L::is_code(c2, 1024)));
  const F m0 = L::values(c0), m1 = L::values(c1), m2 = L::values(c2);
  // sum m_k cos(p + theta_k) = A cos p + B sin p with A = m0 - (m1 + m2) / 2 and B = sqrt(3) / 2 (m2 - m1); likewise for the sine.
  const F real = m0 * kValue - (m1 + m2) * (0.5f * kValue), imaginary = (m2 - m1) * (0.8660254f * kValue);
  const F a = real * cosine + imaginary * sine, b = imaginary * cosine - real * sine;
  const F n = L::root(a * a + b * b), inverse = 1.0f / L::most(n, L::all(kTiny));
  return {L::select(saturated, L::all(0), n), a * inverse, b * inverse, L::select(saturated, L::all(kSaturatedAmplitude), n * kAmplitude)};
}

template <class L>
struct SmoothedVector {
  typename L::F a, b, weight;  ///< the vector is (a, b) / weight
  typename L::M agree;         ///< the neighbours point nearly the same way
};

/// The bilateral filter over 3 x 3 vectors of one frequency: at(row, column) gives the PhaseVector so far away (-1, 0, 1; its infrared is not looked at).
/// `kSomeWeak`: there may be weak or missing vectors among the centres; where there are none the answer is the same.
template <bool kSomeWeak, class L, class At>
BOOTH_HOST_DEVICE_LONG SmoothedVector<L> smooth_phase(const DecodeNumbers& w, const At& at) {
  using F = typename L::F;
  const PhaseVector<L> c = at(0, 0);
  const auto weak = L::above(L::all(kWeak), c.length);
  const F limit = kSomeWeak ? L::select(weak, L::all(1e-15f), L::all(kWeak)) : L::all(kWeak);
  const F centre = c.length * kCentreWeight;
  F weight = L::all(kCentreWeight), a = centre * c.a, b = centre * c.b, distance = L::all(0);
  const auto add = [&](int row, int column, const float* root8, float gauss) {
    const PhaseVector<L> q = at(row, column);
    const F twice = 1.0f - c.a * q.a - c.b * q.b;
    F g = root8[0] + twice * (root8[1] + twice * (root8[2] + twice * (root8[3] + twice * root8[4])));
    g *= g, g *= g, g *= g;
    if (kSomeWeak) g = L::select(weak, L::all(gauss), g);
    const auto use = L::at_least(q.length, limit);
    g = L::keep(use, g);
    const F gn = g * q.length;
    weight += g;
    a += gn * q.a;
    b += gn * q.b;
    distance += L::keep(use, twice);
  };
  add(-1, -1, w.corner, kCornerWeight), add(-1, 0, w.side, kSideWeight), add(-1, 1, w.corner, kCornerWeight);
  add(0, -1, w.side, kSideWeight), add(0, 1, w.side, kSideWeight);
  add(1, -1, w.corner, kCornerWeight), add(1, 0, w.side, kSideWeight), add(1, 1, w.corner, kCornerWeight);
  auto agree = L::above(L::all(5), distance);
  if (kSomeWeak) {
    const auto there = L::above(c.length, L::all(0));
    agree = L::both(agree, there);
    a = L::keep(there, a), b = L::keep(there, b);
  }
  return {a, b, weight, agree};
}

template <class L>
struct Polar {
  typename L::F amplitude, turn;  ///< turn from 0 to 1
};

template <class L>
BOOTH_HOST_DEVICE_LONG Polar<L> polar(typename L::F a, typename L::F b, typename L::F weight) {
  using F = typename L::F;
  const F absolute_a = L::magnitude(a), absolute_b = L::magnitude(b);
  const F high = L::most(L::most(absolute_a, absolute_b), L::all(kTiny)), low = L::least(absolute_a, absolute_b);
  const F inverse = 1.0f / (high * weight), t = low * (weight * inverse), t2 = t * t;
  // Minimax polynomial of the arc tangent from 0 to 1, in turns; the error is below 4e-7 of a turn.
  F turn = t * (0.15915482f +
                t2 * (-0.0530394639f + t2 * (0.0316273344f + t2 * (-0.0214029404f + t2 * (0.0132299859f + t2 * (-0.0057869423f + t2 * (0.00121727333f)))))));
  turn = L::select(L::above(absolute_b, absolute_a), 0.25f - turn, turn);
  turn = L::select(L::above(L::all(0), a), 0.5f - turn, turn);
  turn = L::select(L::above(L::all(0), b), 1.0f - turn, turn);
  return {L::root(a * a + b * b) * (high * inverse * kAmplitude), turn};
}

/// Square of the residual limit, in turns, before it is clamped: scale n^-1.0661156, by logarithm and power of two.
template <class L>
BOOTH_HOST_DEVICE_LONG typename L::F residual_limit(typename L::F n, float scale) {
  using F = typename L::F;
  const typename L::I raw = L::bits(L::most(n, L::all(1)));
  const F exponent = L::number((raw >> 23) - 127), m = L::from_bits((raw & 0x007F'FFFF) | 0x3F80'0000) - 1.0f;
  const F y = (exponent + m * (1.44268147f + m * (-0.720358773f + m * (0.468658879f + m * (-0.30163801f + m * (0.144471096f + m * (-0.033822046f))))))) *
              -1.0661156f,
          whole = L::down(y), part = y - whole;
  const F power = 1.00000349f + part * (0.692972922f + part * (0.241604357f + part * (0.0517449978f + part * (0.0136703095f))));
  return L::shift_exponent(power, L::whole(whole)) * scale;
}

/// Of a pixel: the sum of the three amplitudes, and millimetres along z, 0 where there is nothing.
template <class L>
struct Ranged {
  typename L::F sum, range;
};

/// `p`: three phases and amplitudes; `s`, `xu`: the pixel's ray (lens.hpp), s = 0: no depth there.
template <class L>
BOOTH_HOST_DEVICE_LONG Ranged<L> unwrap_phases(const DecodeNumbers& w, const Polar<L>* p, typename L::M agree, typename L::F s, typename L::F xu) {
  using F = typename L::F;
  const F total = p[0].amplitude + p[1].amplitude + p[2].amplitude;
  const F lowest = L::least(p[0].amplitude, L::least(p[1].amplitude, p[2].amplitude)),
          highest = L::most(p[0].amplitude, L::most(p[1].amplitude, p[2].amplitude));
  auto good = L::both(agree, L::both(L::at_least(lowest, L::all(3)), L::at_least(total, L::all(10))));
  if (!L::any(good)) return {total, L::all(0)};
  // Base units of 625 mm: periods of 3, 15 and 2.
  const F u0 = p[0].turn * 3.0f, u1 = p[1].turn * 15.0f, u2 = p[2].turn * 2.0f;
  F u = u0 + 3.0f * L::down((u1 - u0) * (1.0f / 3) + 0.5f);
  const F apart = L::magnitude(u - u2), e = apart - 2.0f * L::down(0.5f * apart);
  const F half = L::keep(L::both(L::above(e, L::all(0.5f)), L::above(L::all(1.5f), e)), L::all(15));
  u += half;
  const F v1 = u1 + half, v2 = u2 + 2.0f * L::down(0.5f * (u - u2) + 0.5f);
  const F c0 = u * (1.0f / 3), c1 = v1 * (1.0f / 15), c2 = 0.5f * v2, mean = (c0 + c1 + c2) * (1.0f / 3);
  const float h0 = 0.551317818f, h1 = 0.110263564f, h2 = 0.826976727f;
  const F rx = h1 * c2 - h2 * c1, ry = h2 * c0 - h0 * c2, rz = h0 * c1 - h1 * c0, residual = rx * rx + ry * ry + rz * rz;
  const F strictest = L::all(0.0030864198f), loosest = L::all(0.0094521606f);  // 20 and 35 degrees, squared, in turns
  F limit = strictest;
  if (L::any(L::both(good, L::above(residual, strictest)))) limit = L::least(L::most(residual_limit<L>(highest, w.residual_scale), strictest), loosest);
  const F d = mean * (2 * 2083.3333f), denominator = 2.0f * d * s - 90.0f * xu;
  good = L::both(L::both(good, L::at_least(limit, residual)),
                 L::both(L::at_least(mean, L::all(0)), L::both(L::above(s, L::all(0)), L::above(denominator, L::all(0)))));
  return {total, L::keep(good, d * d / L::most(denominator, L::all(1e-6f)))};
}

template <class L>
BOOTH_HOST_DEVICE typename L::F within_limits(const DecodeNumbers& w, typename L::F z) {
  return L::keep(L::both(L::at_least(z, L::all(w.minimum)), L::at_least(L::all(w.maximum), z)), z);
}

/// Three pixels one above the other, for the edge filter.
template <class L>
struct EdgeColumn {
  typename L::F sum, squares, nearest, farthest;  ///< of the amplitudes; of the ranges (nearest: far away where there is none)
};
template <class L>
BOOTH_HOST_DEVICE EdgeColumn<L> edge_column(const Ranged<L>& above, const Ranged<L>& here, const Ranged<L>& below) {
  using F = typename L::F;
  const auto near = [](F z) { return L::select(L::above(z, L::all(0)), z, L::all(1e9f)); };
  const F s0 = above.sum, s1 = here.sum, s2 = below.sum, z0 = above.range, z1 = here.range, z2 = below.range;
  return {s0 + s1 + s2, s0 * s0 + s1 * s1 + s2 * s2, L::least(near(z0), L::least(near(z1), near(z2))), L::most(z0, L::most(z1, z2))};
}

/// The pixel's depth, unless it lies on the edge between two surfaces.
template <class L>
BOOTH_HOST_DEVICE typename L::F without_edge(const DecodeNumbers& w, typename L::F range, const EdgeColumn<L>& left, const EdgeColumn<L>& here,
                                             const EdgeColumn<L>& right) {
  using F = typename L::F;
  const F z = within_limits<L>(w, range);
  const F total = left.sum + (here.sum + right.sum), squares = left.squares + (here.squares + right.squares), floor = L::most(total, L::all(450));
  const F low = z - L::least(left.nearest, L::least(here.nearest, right.nearest)), high = L::most(left.farthest, L::most(here.farthest, right.farthest)) - z;
  // 81 times variance against (0.05 * 9)^2 of the mean: rounding is some 1e-4 of what is compared.
  const auto uneven = L::at_least(9.0f * squares - total * total, 0.0025f * floor * floor);
  const auto edge = L::both(L::both(uneven, L::above(low, L::all(50))), L::both(L::above(high, L::all(30)), L::above(L::most(low, high), L::all(100))));
  return L::select(edge, L::all(0), z);
}

/// To a whole number of 16 bits.
BOOTH_HOST_DEVICE std::uint16_t to_count(float value, float scale) {
  const float v = value * scale;
  return static_cast<std::uint16_t>(static_cast<std::int32_t>((v < 65535.0f ? v : 65535.0f) + 0.5f));
}

}  // namespace booth::drivers::kinect2

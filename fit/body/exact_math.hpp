// Sine and cosine with the same bits on every machine: glibc picks its kernels by CPU, and the fit signature must not depend on that.
#pragma once

#include <cmath>

namespace booth::fit {

struct SinCos {
  double sin, cos;
};

/// Cody-Waite reduction and minimax polynomials; |error| < 4e-16 for |x| < 1e5. Only + - * and nearbyint, which IEEE 754 fixes.
inline SinCos exact_sincos(double x) {
  constexpr double two_over_pi = 0.63661977236758134308;
  constexpr double pi_2_hi = 1.57079632673412561417, pi_2_mid = 6.07710050630396597660e-11, pi_2_lo = 2.02226624879595063154e-21;
  const double n = std::nearbyint(x * two_over_pi);
  const double r = ((x - n * pi_2_hi) - n * pi_2_mid) - n * pi_2_lo;
  const double z = r * r;
  // Taylor coefficients to x^17 / x^16: on |r| <= pi/4 the remainder is below 1e-17.
  const double s =
      r + r * z *
              (-1.0 / 6 +
               z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880 + z * (-1.0 / 39916800 + z * (1.0 / 6227020800.0 + z * (-1.0 / 1307674368000.0)))))));
  const double c =
      1.0 - 0.5 * z +
      z * z *
          (1.0 / 24 +
           z * (-1.0 / 720 + z * (1.0 / 40320 + z * (-1.0 / 3628800 + z * (1.0 / 479001600.0 + z * (-1.0 / 87178291200.0 + z * (1.0 / 20922789888000.0)))))));
  switch (static_cast<long long>(n) & 3) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}

/// Angle of the direction (cosine, sine), of length one, in (-pi, pi]; |error| < 1e-15. Newton's steps on exact_sincos() from a rough first guess.
inline double exact_angle(double sine, double cosine) {
  const bool steep = std::abs(sine) > std::abs(cosine);
  const double small = steep ? cosine : sine;  // of the two, that whose arcsine is well-behaved
  double angle = small * (1 + small * small * 0.2);
  for (int k = 0; k < 4; ++k) {
    const SinCos at = exact_sincos(angle);
    angle += (small - at.sin) / at.cos;
  }
  constexpr double pi = 3.14159265358979323846;
  if (steep) return sine > 0 ? pi / 2 - angle : angle - pi / 2;
  return cosine > 0 ? angle : (sine >= 0 ? pi : -pi) - angle;
}

}  // namespace booth::fit

// Masked least squares over a 5 x 5 window, written so that the compiler handles sixteen pixels at a time.
#include "fit/cloud/organised_normals.hpp"

#include <algorithm>

#include "fit/kernel.hpp"

namespace booth::fit {
namespace {

constexpr float kLeastDeterminant = 20;

}  // namespace

// Two loops, and no branch in either: that is what the vectoriser takes.
BOOTH_KERNEL void fit_inverse_depth(const float* row, std::ptrdiff_t stride, float gate_a, float gate_b, InverseDepthFit& out) {
  struct Sums {
    float n[kNormalLanes], u[kNormalLanes], v[kNormalLanes], uu[kNormalLanes], uv[kNormalLanes], vv[kNormalLanes], w[kNormalLanes], uw[kNormalLanes],
        vw[kNormalLanes];
  };
  Sums sums;
  for (int k = 0; k < kNormalLanes; ++k) {
    const float* at = row + k;
    const float w = *at, gate = gate_a * w * w + gate_b * w;
    float n = 0, su = 0, sv = 0, suu = 0, suv = 0, svv = 0, sw = 0, suw = 0, svw = 0;
#pragma GCC unroll 5
    for (int v = -kNormalRadius; v <= kNormalRadius; ++v) {
      float rn = 0, ru = 0, ruu = 0, rw = 0, ruw = 0;
#pragma GCC unroll 5
      for (int u = -kNormalRadius; u <= kNormalRadius; ++u) {
        const float other = at[v * stride + u], d = other - w;
        const bool near = (d < gate) & (-d < gate) & (other > 0);
        const float m = near ? 1.0f : 0.0f, md = near ? d : 0.0f;
        const auto fu = static_cast<float>(u);
        rn += m, ru += fu * m, ruu += fu * fu * m;
        rw += md, ruw += fu * md;
      }
      const auto fv = static_cast<float>(v);
      n += rn, su += ru, suu += ruu, sw += rw, suw += ruw;
      sv += fv * rn, svv += fv * fv * rn, suv += fv * ru, svw += fv * rw;
    }
    sums.n[k] = n, sums.u[k] = su, sums.v[k] = sv, sums.uu[k] = suu, sums.uv[k] = suv, sums.vv[k] = svv, sums.w[k] = sw, sums.uw[k] = suw, sums.vw[k] = svw;
  }
  InverseDepthFit fit;
  for (int k = 0; k < kNormalLanes; ++k) {
    const float n = sums.n[k], inverse_n = 1 / std::max(n, 1.0f);
    const float u = sums.u[k] * inverse_n, v = sums.v[k] * inverse_n;  // means
    const float cuu = sums.uu[k] - sums.u[k] * u, cvv = sums.vv[k] - sums.v[k] * v, cuv = sums.uv[k] - sums.u[k] * v;
    const float cuw = sums.uw[k] - sums.w[k] * u, cvw = sums.vw[k] - sums.w[k] * v;
    const float determinant = cuu * cvv - cuv * cuv;  // 2500 for the full window, 0 for a line
    const float inverse = 1 / std::max(determinant, kLeastDeterminant);
    const float a = (cvv * cuw - cuv * cvw) * inverse, b = (cuu * cvw - cuv * cuw) * inverse;
    fit.a[k] = a, fit.b[k] = b;
    fit.w0[k] = row[k] + sums.w[k] * inverse_n - a * u - b * v;
    const bool good = (n > 5.5f) & (determinant > kLeastDeterminant);  // n is 0 where there is no pixel
    fit.support[k] = good ? n : 0.0f;
  }
  out = fit;
}

}  // namespace booth::fit

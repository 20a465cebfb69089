// Masked least squares over a 5 x 5 window, written so that the compiler handles sixteen pixels at a time.
#include "fit/cloud/organised_normals.hpp"

#include "fit/kernel.hpp"

namespace booth::fit {

BOOTH_KERNEL void fit_inverse_depth(const float* row, std::ptrdiff_t stride, float gate_a, float gate_b, InverseDepthFit& out) {
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
    const float safe = n > 0 ? n : 1.0f;
    const float cuu = suu - su * su / safe, cvv = svv - sv * sv / safe, cuv = suv - su * sv / safe;
    const float cuw = suw - su * sw / safe, cvw = svw - sv * sw / safe;
    const float determinant = cuu * cvv - cuv * cuv;  // 2500 for the full window, 0 for a line
    const bool good = (n > 5.5f) & (determinant > 20) & (w > 0);
    const float divisor = good ? determinant : 1.0f;
    const float a = (cvv * cuw - cuv * cvw) / divisor, b = (cuu * cvw - cuv * cuw) / divisor;
    out.w0[k] = w + (sw - a * su - b * sv) / safe;
    out.a[k] = a, out.b[k] = b;
    out.support[k] = good ? n : 0.0f;
  }
}

}  // namespace booth::fit

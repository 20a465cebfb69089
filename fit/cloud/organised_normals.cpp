// Masked least squares over a 5 x 5 window, sixteen pixels at a time in the compiler's vector types.
#include "fit/cloud/organised_normals.hpp"

#include <cstdint>
#include <cstring>

#include "fit/kernel.hpp"

namespace booth::fit {
namespace {

using Floats = float __attribute__((vector_size(kNormalLanes * sizeof(float))));

}  // namespace

BOOTH_KERNEL void fit_inverse_depth(const float* row, std::ptrdiff_t stride, float gate_a, float gate_b, InverseDepthFit& out) {
  Floats w;
  std::memcpy(&w, row, sizeof w);
  const Floats zero = w - w, one = zero + 1.0f;
  const Floats gate = gate_a * w * w + gate_b * w;
  Floats n = zero, su = zero, sv = zero, suu = zero, suv = zero, svv = zero, sw = zero, suw = zero, svw = zero;
  for (int v = -kNormalRadius; v <= kNormalRadius; ++v) {
    Floats rn = zero, ru = zero, ruu = zero, rw = zero, ruw = zero;
    for (int u = -kNormalRadius; u <= kNormalRadius; ++u) {
      Floats other;
      std::memcpy(&other, row + v * stride + u, sizeof other);
      const Floats d = other - w;
      const auto near = (d < gate) & (d > -gate) & (other > zero);
      const Floats m = near ? one : zero, md = near ? d : zero;
      const auto fu = static_cast<float>(u);
      rn += m, ru += fu * m, ruu += fu * fu * m;
      rw += md, ruw += fu * md;
    }
    const auto fv = static_cast<float>(v);
    n += rn, su += ru, suu += ruu, sw += rw, suw += ruw;
    sv += fv * rn, svv += fv * fv * rn, suv += fv * ru, svw += fv * rw;
  }
  const Floats safe = n > zero ? n : one;
  const Floats cuu = suu - su * su / safe, cvv = svv - sv * sv / safe, cuv = suv - su * sv / safe;
  const Floats cuw = suw - su * sw / safe, cvw = svw - sv * sw / safe;
  const Floats determinant = cuu * cvv - cuv * cuv;  // 2500 for the full window, 0 for a line
  const auto good = (n > zero + 5.5f) & (determinant > zero + 20.0f) & (w > zero);
  const Floats divisor = good ? determinant : one;
  const Floats a = (cvv * cuw - cuv * cvw) / divisor, b = (cuu * cvw - cuv * cuw) / divisor;
  const Floats w0 = w + (sw - a * su - b * sv) / safe, support = good ? n : zero;
  std::memcpy(out.w0, &w0, sizeof w0);
  std::memcpy(out.a, &a, sizeof a);
  std::memcpy(out.b, &b, sizeof b);
  std::memcpy(out.support, &support, sizeof support);
}

}  // namespace booth::fit

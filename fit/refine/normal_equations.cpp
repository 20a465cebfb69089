// The one hot loop of refinement: a rank-64 update of the lower triangle, lane by lane.
#include "fit/refine/normal_equations.hpp"

#include <algorithm>

#include "fit/kernel.hpp"

namespace booth::fit {
namespace {

/// product[i * stride + j] = sum_r rows[r][i] rows[r][j] for j < stride rounded up from i + 1; each lane sums its rows in order.
BOOTH_KERNEL void rank_update(const float* rows, int count, int unknowns, int stride, float* product) {
  for (int i = 0; i < unknowns; ++i) {
    float* out = product + i * stride;
    const int width = (i / 16 + 1) * 16;
    for (int j = 0; j < width; ++j) out[j] = 0;
    int r = 0;
    for (; r + 4 <= count; r += 4) {
      const float *a = rows + r * stride, *b = a + stride, *c = b + stride, *d = c + stride;
      const float ai = a[i], bi = b[i], ci = c[i], di = d[i];
      if (ai == 0 && bi == 0 && ci == 0 && di == 0) continue;
      for (int j = 0; j < width; ++j) out[j] += (ai * a[j] + bi * b[j]) + (ci * c[j] + di * d[j]);
    }
    for (; r < count; ++r) {
      const float* a = rows + r * stride;
      const float ai = a[i];
      for (int j = 0; j < width; ++j) out[j] += ai * a[j];
    }
  }
}

/// gradient[i] += residual row[i], lane by lane.
BOOTH_KERNEL void add_gradient(const float* row, double residual, int unknowns, double* gradient) {
  for (int i = 0; i < unknowns; ++i) gradient[i] += residual * static_cast<double>(row[i]);
}

constexpr int kMostStride = (kMaxUnknowns + 15) / 16 * 16;

}  // namespace

NormalEquations::NormalEquations() {
  block_.assign(kBlock * kMostStride, 0);
  residual_.assign(kBlock, 0);
  product_.assign(static_cast<std::size_t>(kMaxUnknowns) * kMostStride, 0);
}

std::size_t NormalEquations::heap_bytes() { return (kBlock * kMostStride + kBlock + static_cast<std::size_t>(kMaxUnknowns) * kMostStride) * sizeof(float); }

void NormalEquations::reset(int unknowns) {
  unknowns_ = unknowns;
  stride_ = (unknowns + 15) / 16 * 16;
  rows_ = 0;
  energy_ = 0;
  hessian_.setZero(unknowns, unknowns);
  gradient_.setZero(unknowns);
}

float* NormalEquations::next_row() {
  if (rows_ == kBlock) flush();
  float* row = block_.data() + rows_ * stride_;
  std::fill_n(row, stride_, 0.0f);
  return row;
}

void NormalEquations::commit(float residual) { residual_[static_cast<std::size_t>(rows_++)] = residual; }

void NormalEquations::flush() {
  if (rows_ == 0) return;
  rank_update(block_.data(), rows_, unknowns_, stride_, product_.data());
  for (int i = 0; i < unknowns_; ++i) {
    const float* product = product_.data() + i * stride_;
    double* sum = hessian_.col(i).data();
    for (int j = 0; j <= i; ++j) sum[j] += static_cast<double>(product[j]);
  }
  for (int r = 0; r < rows_; ++r) {
    const double residual = static_cast<double>(residual_[static_cast<std::size_t>(r)]);
    energy_ += residual * residual;
    add_gradient(block_.data() + r * stride_, residual, unknowns_, gradient_.data());
  }
  rows_ = 0;
}

void NormalEquations::add(NormalEquations& other) {
  flush();
  other.flush();
  hessian_ += other.hessian_;
  gradient_ += other.gradient_;
  energy_ += other.energy_;
}

const UnknownMatrix& NormalEquations::hessian() {
  flush();
  hessian_.triangularView<Eigen::StrictlyLower>() = hessian_.transpose();
  return hessian_;
}

const UnknownVector& NormalEquations::gradient() {
  flush();
  return gradient_;
}

double NormalEquations::energy() {
  flush();
  return energy_;
}

}  // namespace booth::fit

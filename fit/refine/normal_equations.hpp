// Sums weighted rows of a least-squares problem into J^T W J and J^T W r, in one order whatever the machine.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "fit/body/skeleton.hpp"

namespace booth::fit {

inline constexpr int kMaxUnknowns = kDofs + 64;  ///< q and at most kMaxShape coefficients
using UnknownVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxUnknowns, 1>;
using UnknownMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxUnknowns, kMaxUnknowns>;

/// Rows are collected in blocks in single precision and added to double-precision sums. Allocates in the constructor only.
class NormalEquations {
 public:
  NormalEquations();

  void reset(int unknowns);
  int unknowns() const { return unknowns_; }

  /// A zeroed row to be filled with sqrt(w) J; commit it with sqrt(w) r before asking for the next.
  float* next_row();
  void commit(float residual);

  /// Adds all of another accumulator (same unknowns) to this one.
  void add(NormalEquations& other);

  /// J^T W J (full symmetric), J^T W r; the rows collected so far are included.
  const UnknownMatrix& hessian();
  const UnknownVector& gradient();
  /// Sum of w r^2.
  double energy();

  /// Taken by each in the constructor, beside its own size.
  static std::size_t heap_bytes();

 private:
  void flush();
  static constexpr int kBlock = 64;
  int unknowns_ = 0, stride_ = 0, rows_ = 0;
  std::vector<float> block_, residual_, product_;
  UnknownMatrix hessian_;
  UnknownVector gradient_;
  double energy_ = 0;
};

}  // namespace booth::fit

// A linear system over a mesh's vertices whose couplings are the mesh's edges: least squares of one number per vertex, in fixed memory.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "fit/body/body_model.hpp"

namespace booth::fit {

/// Normal equations of observations that each concern one triangle, and their regularised solution. Allocates in the constructor only; sums have one
/// order, so that the same rows give the same bits. One thread at a time.
class SurfaceSystem {
 public:
  /// Throws std::invalid_argument when a face names a vertex that does not exist.
  SurfaceSystem(const Faces& faces, int vertex_count);

  /// Forgets all observations.
  void reset();
  /// Exponential forgetting: what was observed so far counts `factor` times as much.
  void scale(double factor);
  /// Adds weight * (sum_k a_k d(faces(k, face)) - value)^2.
  void add(int face, const std::array<float, 3>& a, float value, float weight);

  struct Regularisation {
    double step = 0;  ///< weight of (d_i - d_j)^2 over every edge (a graph Laplacian)
    double size = 0;  ///< weight of d_i^2
  };
  /// Improves `d` (one entry per vertex) towards the minimum by at most `iterations` steps of conjugate gradients, preconditioned by the diagonal.
  void solve(const Regularisation& regularisation, int iterations, Eigen::VectorXd& d);

  int size() const { return static_cast<int>(diagonal_.size()); }
  /// How much the observations say of a vertex by itself: the diagonal of J^T W J.
  double information(int vertex) const { return diagonal_[vertex]; }
  std::size_t memory_bytes() const;

 private:
  void multiply(const Regularisation& regularisation, const Eigen::VectorXd& in, Eigen::VectorXd& out) const;

  const Faces faces_;
  std::vector<int> first_, neighbour_;                 ///< compressed rows: the vertices around each vertex
  std::vector<std::array<int, 6>> place_;              ///< per face: where its six ordered pairs (01 02 10 12 20 21) stand in `coupling_`
  std::vector<double> coupling_;                       ///< as neighbour_
  Eigen::VectorXd diagonal_, right_;                   ///< J^T W J's diagonal, J^T W value
  Eigen::VectorXd residual_, step_, product_, fresh_;  ///< of the solver
};

}  // namespace booth::fit

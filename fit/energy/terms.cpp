// Scalar reference of every term; the swarm's kernel is tested against these.
#include "fit/energy/terms.hpp"

#include <cmath>

namespace booth::fit {

double shape_energy(const ShapeVector& beta) { return beta.squaredNorm(); }

double bone_energy(const Points3& vectors) {
  double sum = 0;
  for (const auto& [left, right] : kLimbPairs) {
    const double difference = (vectors.col(left).norm() - vectors.col(right).norm()) * kMillimetres;
    sum += difference * difference;
  }
  return sum;
}

double pose_energy(const PosePrior& prior, const PoseVector& q) {
  const PoseAngles d = q.tail<kPoseDofs>() - prior.mean;
  // |d|^2 less the part inside the subspace; clamped, since rounding may take it below zero.
  const Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kPoseDofs, 1> inside = prior.components.transpose() * d;  // bounded size: no heap
  return std::max(0.0, d.squaredNorm() - inside.squaredNorm());
}

double point_energy(const Eigen::Vector3f& vertex, const Eigen::Vector3f& nearest) { return static_cast<double>((vertex - nearest).norm()) * kMillimetres; }

double plane_energy(const Eigen::Vector3f& vertex, const Eigen::Vector3f& normal, const Eigen::Vector3f& nearest) {
  return static_cast<double>(std::abs(normal.dot(vertex - nearest))) * kMillimetres;
}

}  // namespace booth::fit

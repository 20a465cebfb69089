// The paper's energy, term by term (eq. 4-13 in the reading of docs/design/energy.md), each usable and testable by itself.
#pragma once

#include <array>
#include <utility>

#include "fit/body/body_model.hpp"
#include "fit/prior/pose_prior.hpp"

namespace booth::fit {

/// Eq. 4's weights l1..l5 in the paper's order: point, plane, shape, bone, pose.
struct PaperWeights {
  double point = 1, plane = 3, shape = 1e3, bone = 0.03, pose = 10;
};

/// The unit of E_point, E_plane (mm) and E_bone (mm^2), and the number of vertices that the sums are scaled to.
inline constexpr double kMillimetres = 1000;
inline constexpr double kPaperVertices = 1000;

/// Left and right segments that eq. 7 compares: thigh, shank, upper arm, forearm (bone indices).
inline constexpr std::array<std::pair<int, int>, 4> kLimbPairs{{{2, 7}, {3, 8}, {14, 18}, {15, 19}}};

/// Eq. 9 for whitened coefficients: the squared Mahalanobis distance |beta|^2.
double shape_energy(const ShapeVector& beta);

/// Eq. 7: sum over the four limbs' segment pairs of (l_left - l_right)^2, mm^2. The columns of `vectors` are bone vectors (m).
double bone_energy(const Points3& vectors);

/// Eq. 12: squared distance of the joint angles q[6..35] from the prior's subspace, rad^2.
double pose_energy(const PosePrior& prior, const PoseVector& q);

/// One vertex's share of eq. 5 (not squared: L2,1): |v - p|, mm.
double point_energy(const Eigen::Vector3f& vertex, const Eigen::Vector3f& nearest);

/// One vertex's share of eq. 6: |n . (v - p)| with the model vertex's normal, mm.
double plane_energy(const Eigen::Vector3f& vertex, const Eigen::Vector3f& normal, const Eigen::Vector3f& nearest);

}  // namespace booth::fit

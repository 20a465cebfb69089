// Every point of the cloud pulls the nearest vertex of the body; angles that no point feels stay where they are.
#include "tests/accuracy/icp/articulated_icp.hpp"

#include <Eigen/Cholesky>
#include <algorithm>

#include "fit/body/poser.hpp"
#include "fit/cloud/point_grid.hpp"
#include "fit/refine/normal_equations.hpp"

namespace booth::accuracy {
namespace {

constexpr int kIterations = 60, kPoints = 3000, kVertices = 3000;
constexpr float kFirstReach = 0.4f, kLastReach = 0.08f;  // m
constexpr double kDamping = 1e-2;                        // of the mean diagonal: holds what no point feels
constexpr double kLongestTurn = 0.3;                     // rad (and m) of one step

}  // namespace

fit::PoseVector fit_articulated_icp(const fit::BodyModel& model, const fit::Cloud& cloud, const fit::PoseVector& start) {
  fit::Poser poser(model, 1, kVertices);
  poser.set_shape(fit::ShapeVector::Zero(1));
  fit::PointGrid grid(poser.size());
  fit::NormalEquations equations;
  fit::PoseVector q = start;
  const int points = std::min(cloud.size, kPoints);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    poser.set_pose(q);
    grid.rebuild(poser.x.data(), poser.y.data(), poser.z.data(), poser.size());
    equations.reset(fit::kDofs);
    const float reach = kFirstReach + static_cast<float>(iteration) / (kIterations - 1) * (kLastReach - kFirstReach);
    for (int s = 0; s < points; ++s) {
      const auto i = static_cast<std::size_t>(static_cast<std::int64_t>(s) * cloud.size / points);
      const Eigen::Vector3f p(cloud.x[i], cloud.y[i], cloud.z[i]);
      const int v = grid.nearest(p, reach);
      if (v < 0) continue;
      const Eigen::Vector3f off = poser.position(v) - p;
      for (int axis = 0; axis < 3; ++axis) {
        poser.pose_row(v, Eigen::Vector3f::Unit(axis), equations.next_row());
        equations.commit(off[axis]);
      }
    }
    fit::UnknownMatrix h = equations.hessian();
    h.diagonal().array() += kDamping * h.diagonal().mean() + 1e-9;
    const fit::UnknownVector step = h.ldlt().solve(equations.gradient());
    q -= step.head<fit::kDofs>() / std::max(1.0, step.cwiseAbs().maxCoeff() / kLongestTurn);
  }
  return q;
}

}  // namespace booth::accuracy

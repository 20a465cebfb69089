// Angles in the conventions of fit/body/skeleton.hpp; degrees here for the reader's sake.
#include "tests/support/plain_prior.hpp"

#include <initializer_list>
#include <numbers>
#include <string_view>
#include <utility>

namespace booth::tests {
namespace {

using Angles = std::initializer_list<std::pair<std::string_view, double>>;

fit::PoseVector pose(Angles angles) {
  fit::PoseVector q = fit::PoseVector::Zero();
  // Parallel legs and hanging arms, then what is different.
  for (const auto& [name, degrees] : Angles{{"lhumerus_rz", 75}, {"rhumerus_rz", -75}, {"lfemur_rz", -20}, {"rfemur_rz", 20}})
    q[fit::dof_index(name)] = degrees * std::numbers::pi / 180;
  for (const auto& [name, degrees] : angles) q[fit::dof_index(name)] = degrees * std::numbers::pi / 180;
  return q;
}

}  // namespace

std::shared_ptr<const fit::PosePrior> plain_prior() {
  auto prior = std::make_shared<fit::PosePrior>();
  prior->version = "by hand";
  prior->mean = pose({}).tail<fit::kPoseDofs>();
  prior->components = Eigen::Matrix<double, fit::kPoseDofs, fit::kPoseDofs>::Identity().leftCols(fit::kPoseDofs);
  prior->sigma = Eigen::VectorXd::Constant(fit::kPoseDofs, 0.6);
  prior->standard_deviation.setConstant(0.6);
  prior->lower.setConstant(-2.6);
  prior->upper.setConstant(2.6);
  for (std::string_view hinge : {"lradius_rx", "rradius_rx", "ltibia_rx", "rtibia_rx"}) {
    prior->lower[fit::dof_index(hinge) - fit::kRootDofs] = -0.1;
    prior->mean[fit::dof_index(hinge) - fit::kRootDofs] = 0.2;
  }
  prior->speed_limit.setConstant(10);
  prior->speed_limit.head<3>().setConstant(2);
  const fit::PoseVector poses[] = {
      pose({}),
      pose({{"lhumerus_rz", 45}, {"rhumerus_rz", -45}}),
      pose({{"lhumerus_rz", 0}, {"rhumerus_rz", 0}}),
      pose({{"lhumerus_rz", -60}, {"rhumerus_rz", 60}}),
      pose({{"lhumerus_rz", -60}}),
      pose({{"rhumerus_rz", 60}}),
      pose({{"lradius_rx", 90}}),
      pose({{"rradius_rx", 90}}),
      pose({{"lradius_rx", 90}, {"rradius_rx", 90}}),
      pose({{"lfemur_rx", -30}, {"rfemur_rx", 20}, {"rtibia_rx", 20}}),
      pose({{"rfemur_rx", -30}, {"lfemur_rx", 20}, {"ltibia_rx", 20}}),
      pose({{"lfemur_rx", -80}, {"rfemur_rx", -80}, {"ltibia_rx", 100}, {"rtibia_rx", 100}, {"upperback_rx", 20}}),
  };
  prior->exemplars.resize(fit::kDofs, std::size(poses));
  for (std::size_t i = 0; i < std::size(poses); ++i) prior->exemplars.col(static_cast<Eigen::Index>(i)) = poses[i];
  prior->check();
  return prior;
}

}  // namespace booth::tests

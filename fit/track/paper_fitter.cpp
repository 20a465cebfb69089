// The paper names neither spreads nor starts; ours are the priors' standard deviations (docs/design/energy.md).
#include "fit/track/paper_fitter.hpp"

#include <algorithm>
#include <numbers>

namespace booth::fit {
namespace {

constexpr int kHeadings = 8;
constexpr float kMoveDeviation = 0.10f;                                     // m
constexpr float kTurnDeviation = 0.20f;                                     // rad, root
constexpr float kEightHeadings = static_cast<float>(std::numbers::pi) / 8;  // half the way to the neighbouring start
constexpr double kLostDistance = 150;                                       // mm of point distance a vertex, above which the swarm has not found the person

}  // namespace

PaperFitter::PaperFitter(const BodyModel& model, const PosePrior& prior, WorkerPool& pool)
    : model_(model), prior_(prior), energy_(model, prior, kShapeCount, kVertices), swarm_(SwarmSettings{}, energy_.dimensions(), pool) {
  const auto n = static_cast<std::size_t>(energy_.dimensions());
  centres_.resize(kHeadings * n);
  deviation_.resize(n);
  last_.resize(n);
}

Solution PaperFitter::step(const Observation& observation, const NearestField& field, const Random& random, const PoseVector* initial) {
  Solution s;
  const int n = energy_.dimensions();
  s.beta = ShapeVector::Zero(n - kDofs);
  const Cloud& cloud = observation.cloud;
  if (cloud.size < 50) return s;
  energy_.set_observation(cloud, field);

  for (int k = 0; k < 3; ++k) deviation_[k] = kMoveDeviation;
  for (int k = 3; k < kRootDofs; ++k) deviation_[k] = kTurnDeviation;
  for (int k = 0; k < kPoseDofs; ++k) deviation_[kRootDofs + k] = static_cast<float>(prior_.standard_deviation[k]);
  std::fill(deviation_.begin() + kDofs, deviation_.end(), 1.0f);

  int starts = 1;
  if (initial) {
    for (int k = 0; k < kDofs; ++k) centres_[k] = static_cast<float>((*initial)[k]);
    std::fill(centres_.begin() + kDofs, centres_.begin() + n, 0.0f);
  } else if (known_) {
    std::copy(last_.begin(), last_.end(), centres_.begin());
  } else {
    Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
    for (int i = 0; i < cloud.size; ++i) centroid += Eigen::Vector3d(cloud.x[i], cloud.y[i], cloud.z[i]);
    centroid /= cloud.size;
    // The template's own centre of area goes to the cloud's.
    const Eigen::Vector3d centre = (model_.data().mean * model_.vertex_area()).cast<double>() / static_cast<double>(model_.vertex_area().sum());
    starts = kHeadings;
    deviation_[4] = kEightHeadings;
    for (int h = 0; h < kHeadings; ++h) {
      float* c = centres_.data() + h * n;
      std::fill_n(c, n, 0.0f);
      for (int k = 3; k < kDofs; ++k) c[k] = static_cast<float>(model_.rest_pose()[k]);
      for (int k = 0; k < 3; ++k) c[k] = static_cast<float>(centroid[k] - centre[k]);
      c[4] = static_cast<float>(h * std::numbers::pi / 4 - (h > 4 ? 2 * std::numbers::pi : 0.0));
    }
  }

  const float cost = swarm_.minimise({centres_.data(), static_cast<std::size_t>(starts * n)}, deviation_, random,
                                     [&](int, const float* particle) { return static_cast<float>(energy_.energy(particle)); });
  const std::span<const float> best = swarm_.best();
  for (int k = 0; k < kDofs; ++k) s.q[k] = static_cast<double>(best[k]);
  for (int k = kDofs; k < n; ++k) s.beta[k - kDofs] = static_cast<double>(best[k]);
  s.report.energy = static_cast<double>(cost);
  s.report.iterations = s.iterations = swarm_.settings().iterations;
  s.found = energy_.evaluate(best.data()).point / kPaperVertices < kLostDistance;
  return s;
}

void PaperFitter::adopt(const Solution& solution) {
  for (int k = 0; k < kDofs; ++k) last_[k] = static_cast<float>(solution.q[k]);
  for (int k = kDofs; k < energy_.dimensions(); ++k) last_[k] = static_cast<float>(solution.beta[k - kDofs]);
  known_ = true;
}

}  // namespace booth::fit

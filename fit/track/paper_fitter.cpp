// The paper names neither spreads nor starts; ours are the priors' standard deviations (docs/design/energy.md).
#include "fit/track/paper_fitter.hpp"

#include <algorithm>
#include <limits>
#include <numbers>

namespace booth::fit {
namespace {

constexpr int kHeadings = 8;
constexpr float kMoveDeviation = 0.10f;                                     // m
constexpr float kTurnDeviation = 0.20f;                                     // rad, root
constexpr float kEightHeadings = static_cast<float>(std::numbers::pi) / 8;  // half the way to the neighbouring start
constexpr double kLostDistance = 150;                                       // mm of point distance a vertex, above which the swarm has not found the person

}  // namespace

PaperFitter::PaperFitter(const BodyModel& model, const PosePrior& prior, SwarmBackend& backend, int index)
    : model_(model), prior_(prior), backend_(backend), index_(index) {
  const auto n = static_cast<std::size_t>(backend.dimensions(index));
  centres_.resize(kHeadings * n);
  deviation_.resize(n);
  last_.resize(n);
  particle_.resize(n);
}

Solution PaperFitter::step(const Observation& observation, const RandomKey& key, const PoseVector* initial) {
  Solution s;
  const int n = backend_.dimensions(index_);
  s.beta = ShapeVector::Zero(n - kDofs);
  const Cloud& cloud = observation.cloud;
  if (cloud.size < 50) return s;

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

  SwarmResult swarm;
  if (!backend_.minimise(index_, {centres_.data(), static_cast<std::size_t>(starts * n)}, deviation_, key, swarm)) return s;
  for (int k = 0; k < kDofs; ++k) s.q[k] = static_cast<double>(swarm.best[static_cast<std::size_t>(k)]);
  for (int k = kDofs; k < n; ++k) s.beta[k - kDofs] = static_cast<double>(swarm.best[static_cast<std::size_t>(k)]);
  s.report.energy = static_cast<double>(swarm.cost);
  s.report.iterations = s.iterations = backend_.settings().iterations;
  s.found = static_cast<double>(terms(s).point) / kPaperVertices < kLostDistance;
  return s;
}

ParticleTerms PaperFitter::terms(const Solution& solution) {
  for (int k = 0; k < kDofs; ++k) particle_[static_cast<std::size_t>(k)] = static_cast<float>(solution.q[k]);
  for (int k = 0; k < solution.beta.size(); ++k) particle_[static_cast<std::size_t>(kDofs + k)] = static_cast<float>(solution.beta[k]);
  ParticleTerms out{};
  if (!backend_.evaluate(index_, particle_, out)) out.point = std::numeric_limits<float>::max();
  return out;
}

void PaperFitter::adopt(const Solution& solution) {
  for (int k = 0; k < kDofs; ++k) last_[k] = static_cast<float>(solution.q[k]);
  for (int k = kDofs; k < backend_.dimensions(index_); ++k) last_[k] = static_cast<float>(solution.beta[k - kDofs]);
  known_ = true;
}

}  // namespace booth::fit

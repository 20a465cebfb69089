// What the swarm's tests stand on: a posed body's cloud, and a swarm about a pose some way off.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "fit/swarm/backend.hpp"
#include "tests/support/capsule_body.hpp"
#include "tests/support/plain_prior.hpp"
#include "tests/support/posed_cloud.hpp"

namespace booth::tests {

/// The capsule body with as many coefficients as preset paper has: the last five move every vertex along its own direction by up to 2 cm.
inline std::shared_ptr<const fit::BodyModel> fifteen_shapes() {
  fit::BodyModelData data = capsule_body_data();
  const Eigen::Index known = data.directions.cols();
  data.directions.conservativeResize(Eigen::NoChange, 15);
  data.explained = Eigen::VectorXd::LinSpaced(15, 0.5, 0.9);
  for (Eigen::Index k = known; k < 15; ++k)
    for (Eigen::Index i = 0; i < data.directions.rows(); ++i) {
      const float height = data.mean(1, i / 3);
      data.directions(i, k) = 0.02f * std::sin(static_cast<float>(k) * height + static_cast<float>(i % 3));
    }
  // Left and right stay mirror images.
  for (Eigen::Index v = 0; v < data.mean.cols(); ++v)
    if (const int m = data.mirror_vertex[v]; m >= v)
      for (Eigen::Index k = known; k < 15; ++k) {
        data.directions(3 * m, k) = m == v ? 0.0f : -data.directions(3 * v, k);
        if (m == v) data.directions(3 * v, k) = 0;
        for (int c : {1, 2}) data.directions(3 * m + c, k) = data.directions(3 * v + c, k);
      }
  return std::make_shared<const fit::BodyModel>(std::move(data));
}

struct SwarmScene {
  std::shared_ptr<const fit::BodyModel> model;
  std::shared_ptr<const fit::PosePrior> prior = plain_prior();
  fit::PoseVector truth = pose_with({{"lhumerus_rz", 30}, {"rradius_rx", 40}, {"lfemur_rx", -25}});
  fit::Observation observation;
  std::vector<float> centre, deviation;
  fit::SwarmSizes sizes;

  explicit SwarmScene(int particles = 333, int iterations = 10, int vertices = 512, std::shared_ptr<const fit::BodyModel> body = capsule_body())
      : model(std::move(body)),
        observation(make_observation()),
        sizes{.swarm = {.particles = particles, .iterations = iterations}, .energy = {.vertices = vertices}} {
    const int d = fit::kDofs + std::min(sizes.energy.shape_count, model->shape_count());
    centre.assign(static_cast<std::size_t>(d), 0);
    const fit::PoseVector start = pose_with({});
    for (int k = 0; k < fit::kDofs; ++k) centre[static_cast<std::size_t>(k)] = static_cast<float>(start[k]);
    deviation.assign(static_cast<std::size_t>(d), 0.3f);
    for (std::size_t k = 0; k < 3; ++k) deviation[k] = 0.05f;
  }
  fit::Observation make_observation() const {
    fit::ShapeVector beta = fit::ShapeVector::Zero(model->shape_count());
    beta[0] = 0.8;
    return posed_cloud(*model, beta, truth, 0.003f, 4);
  }
  std::unique_ptr<fit::SwarmBackend> make(fit::WorkerPool& pool, const std::string& kernel = {}) const {
    const fit::BodyModel* one = model.get();
    return fit::make_cpu_swarm({&one, 1}, *prior, sizes, pool, kernel);
  }
  std::vector<float> particle(unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<float> gauss;
    std::vector<float> p = centre;
    for (std::size_t k = 0; k < p.size(); ++k) p[k] += 2 * deviation[k] * gauss(random);
    return p;
  }
};

}  // namespace booth::tests

// What the swarm's tests stand on: a posed body's cloud, and a swarm about a pose some way off.
#pragma once

#include <memory>
#include <vector>

#include "fit/swarm/backend.hpp"
#include "tests/support/capsule_body.hpp"
#include "tests/support/plain_prior.hpp"
#include "tests/support/posed_cloud.hpp"

namespace booth::tests {

struct SwarmScene {
  std::shared_ptr<const fit::BodyModel> model = capsule_body();
  std::shared_ptr<const fit::PosePrior> prior = plain_prior();
  fit::PoseVector truth = pose_with({{"lhumerus_rz", 30}, {"rradius_rx", 40}, {"lfemur_rx", -25}});
  fit::Observation observation = posed_cloud(*model, some_shape(), truth, 0.003f, 4);
  std::vector<float> centre, deviation;
  fit::SwarmSizes sizes;

  SwarmScene(int particles, int iterations, int vertices)
      : sizes{.swarm = {.particles = particles, .iterations = iterations}, .energy = {.vertices = vertices}} {
    const int d = fit::kDofs + std::min(sizes.energy.shape_count, model->shape_count());
    centre.assign(static_cast<std::size_t>(d), 0);
    const fit::PoseVector start = pose_with({});
    for (int k = 0; k < fit::kDofs; ++k) centre[static_cast<std::size_t>(k)] = static_cast<float>(start[k]);
    deviation.assign(static_cast<std::size_t>(d), 0.3f);
    for (std::size_t k = 0; k < 3; ++k) deviation[k] = 0.05f;
  }
  fit::ShapeVector some_shape() const {
    fit::ShapeVector beta = fit::ShapeVector::Zero(model->shape_count());
    beta[0] = 0.8;
    return beta;
  }
};

}  // namespace booth::tests

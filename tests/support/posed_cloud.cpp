// Built from the Poser, which is tested against the model's own posing.
#include "tests/support/posed_cloud.hpp"

#include <numbers>

#include "fit/swarm/random.hpp"
#include "tests/support/plain_prior.hpp"

namespace booth::tests {

fit::Observation posed_cloud(const fit::BodyModel& model, const fit::ShapeVector& beta, const fit::PoseVector& q, float noise, std::uint64_t seed) {
  fit::Poser poser(model, model.shape_count(), model.vertex_count());
  poser.set_shape(beta);
  poser.set_pose(q);
  fit::Observation observation(poser.size());
  const fit::Random random(seed, 0);
  for (int i = 0; i < poser.size(); ++i) {
    const float shift = noise * fit::Random::normal(random.words(static_cast<std::uint32_t>(i), 0, 0));
    observation.cloud.push(poser.position(i) + shift * poser.normal(i), poser.normal(i), 0);
  }
  return observation;
}

fit::PoseVector pose_with(std::initializer_list<std::pair<std::string_view, double>> degrees) {
  fit::PoseVector q = plain_prior()->exemplars.col(0);
  q[1] = 0.93;
  for (const auto& [name, angle] : degrees) q[fit::dof_index(name)] = angle * std::numbers::pi / 180;
  return q;
}

}  // namespace booth::tests

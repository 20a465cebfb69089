// Why the energy has two sides: distance from the model to the cloud alone is content with a limb inside the torso (docs/design/energy.md).
#include <gtest/gtest.h>

#include "fit/refine/refiner.hpp"
#include "tests/support/capsule_body.hpp"
#include "tests/support/plain_prior.hpp"
#include "tests/support/posed_cloud.hpp"

namespace booth::fit {
namespace {

/// Mean distance from the model's vertices to the nearest cloud point, m: what eq. 5 sums.
double one_sided(const Poser& poser, const Cloud& cloud) {
  PointGrid grid(cloud.capacity());
  grid.rebuild(cloud.x.data(), cloud.y.data(), cloud.z.data(), cloud.size);
  double sum = 0;
  for (int i = 0; i < poser.size(); ++i) {
    const int c = grid.nearest(poser.position(i), 10.0f);
    sum += static_cast<double>((poser.position(i) - Eigen::Vector3f(cloud.x[c], cloud.y[c], cloud.z[c])).norm());
  }
  return sum / poser.size();
}

TEST(Collapse, OneSidedEnergyFallsWhileTheArmIsLostAndTwoSidedFindsIt) {
  const auto model = tests::capsule_body();
  const auto prior = tests::plain_prior();
  const ShapeVector beta = ShapeVector::Zero(tests::kCapsuleShapes);
  const PoseVector truth = tests::pose_with({{"lhumerus_rz", 5}});   // the left arm held out to the side
  const PoseVector start = tests::pose_with({{"lhumerus_rz", 60}});  // the model's hangs
  const Observation observation = tests::posed_cloud(*model, beta, truth);

  WorkerPool pool(1);
  Refiner refiner(*model, *prior, {.shape_count = tests::kCapsuleShapes, .vertices = model->vertex_count(), .model_samples = model->vertex_count()}, pool);
  const ShapeBelief population{beta, UnknownMatrix::Identity(tests::kCapsuleShapes, tests::kCapsuleShapes)};
  const auto wrist_error = [&] {
    Kinematics k;
    forward_kinematics(truth, model->bone_vectors(beta), k);
    const int wrist = joint_index("lwrist");
    return (refiner.poser().kinematics().joint.col(wrist) - k.joint.col(wrist)).norm();
  };
  refiner.place(start, beta);
  const double energy_before = one_sided(refiner.poser(), observation.cloud), error_before = wrist_error();

  RefineSchedule schedule{.cloud_samples = observation.cloud.size,
                          .model_samples = model->vertex_count(),
                          .model_to_cloud = true,
                          .shape = true,
                          .stages = {{40, 0.3f, 0.6f}, {20, 0.1f, 0.4f}}};
  RefineWeights weights;
  weights.effective_points = 0;  // nothing asks whether the cloud is explained
  weights.model_to_cloud = 600;
  PoseVector q = start;
  ShapeVector b = beta;
  refiner.refine(observation, weights, schedule, {}, population, nullptr, q, b);
  EXPECT_LT(one_sided(refiner.poser(), observation.cloud), energy_before);
  EXPECT_LT(one_sided(refiner.poser(), observation.cloud), 0.03);
  EXPECT_GT(wrist_error(), 0.8 * error_before) << "the one-sided energy should not have found the arm";

  q = start, b = beta;
  refiner.refine(observation, {}, schedule, {}, population, nullptr, q, b);
  EXPECT_LT(wrist_error(), 0.03);
}

}  // namespace
}  // namespace booth::fit

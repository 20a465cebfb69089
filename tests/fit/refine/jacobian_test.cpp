// The analytic derivatives of vertices and joints against central differences.
#include <gtest/gtest.h>

#include "fit/body/poser.hpp"
#include "fit/swarm/random.hpp"
#include "tests/support/capsule_body.hpp"

namespace booth::fit {
namespace {

PoseVector random_pose(std::uint32_t n) {
  const Random random(7, n);
  PoseVector q;
  for (int i = 0; i < kDofs; ++i) q[i] = 0.5 * static_cast<double>(Random::normal(random.words(0, static_cast<std::uint32_t>(i), 0)));
  return q;
}

ShapeVector random_shape(std::uint32_t n, int size) {
  const Random random(8, n);
  ShapeVector b(size);
  for (int i = 0; i < size; ++i) b[i] = static_cast<double>(Random::normal(random.words(0, static_cast<std::uint32_t>(i), 0)));
  return b;
}

class Jacobian : public testing::TestWithParam<std::uint32_t> {
 protected:
  std::shared_ptr<const BodyModel> model = tests::capsule_body();
  Poser poser{*model, model->shape_count(), model->vertex_count()};
  PoseVector q = random_pose(GetParam());
  ShapeVector beta = random_shape(GetParam(), model->shape_count());
  const Eigen::Vector3f directions[3]{Eigen::Vector3f::UnitX(), Eigen::Vector3f::UnitY(), Eigen::Vector3f::UnitZ()};
};

TEST_P(Jacobian, VertexByPoseMatchesDifferences) {
  constexpr double h = 2e-3;
  poser.set_shape(beta);
  poser.set_pose(q);
  std::vector<std::array<std::array<float, kDofs>, 3>> rows(static_cast<std::size_t>(poser.size()));
  for (int v = 0; v < poser.size(); v += 13)
    for (int c = 0; c < 3; ++c) {
      rows[v][c].fill(0);
      poser.pose_row(v, directions[c], rows[v][c].data());
    }
  for (int k = 0; k < kDofs; ++k) {
    PoseVector up = q, down = q;
    up[k] += h, down[k] -= h;
    poser.set_pose(up);
    std::vector<Eigen::Vector3f> above;
    for (int v = 0; v < poser.size(); ++v) above.push_back(poser.position(v));
    poser.set_pose(down);
    for (int v = 0; v < poser.size(); v += 13) {
      const Eigen::Vector3f difference = (above[v] - poser.position(v)) / static_cast<float>(2 * h);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(rows[v][c][k], difference[c], 2e-3) << dof_name(k) << ", vertex " << v << ", coordinate " << c;
    }
  }
}

TEST_P(Jacobian, VertexByShapeMatchesDifferences) {
  constexpr double h = 0.05;  // the map is linear in the shape
  poser.set_shape(beta);
  poser.set_pose(q);
  poser.prepare_shape_derivatives();
  std::vector<std::array<std::array<float, kMaxShape>, 3>> rows(static_cast<std::size_t>(poser.size()));
  for (int v = 0; v < poser.size(); v += 13)
    for (int c = 0; c < 3; ++c) {
      rows[v][c].fill(0);
      poser.shape_row(v, directions[c], rows[v][c].data());
    }
  for (int k = 0; k < model->shape_count(); ++k) {
    ShapeVector up = beta, down = beta;
    up[k] += h, down[k] -= h;
    poser.set_shape(up);
    poser.set_pose(q);
    std::vector<Eigen::Vector3f> above;
    for (int v = 0; v < poser.size(); ++v) above.push_back(poser.position(v));
    poser.set_shape(down);
    poser.set_pose(q);
    for (int v = 0; v < poser.size(); v += 13) {
      const Eigen::Vector3f difference = (above[v] - poser.position(v)) / static_cast<float>(2 * h);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(rows[v][c][k], difference[c], 1e-4) << "coefficient " << k << ", vertex " << v << ", coordinate " << c;
    }
  }
}

TEST_P(Jacobian, JointsMatchDifferences) {
  constexpr double h = 1e-5;
  poser.set_shape(beta);
  poser.set_pose(q);
  poser.prepare_shape_derivatives();
  std::array<Eigen::Matrix<double, 3, kDofs>, kJoints> by_pose;
  for (int j = 0; j < kJoints; ++j) by_pose[j] = poser.joint_pose_jacobian(j);
  Kinematics up, down;
  for (int k = 0; k < kDofs; ++k) {
    PoseVector step = PoseVector::Zero();
    step[k] = h;
    forward_kinematics(q + step, poser.bone_vectors(), up);
    forward_kinematics(q - step, poser.bone_vectors(), down);
    for (int j = 0; j < kJoints; ++j)
      EXPECT_LT((by_pose[j].col(k) - (up.joint.col(j) - down.joint.col(j)) / (2 * h)).norm(), 1e-8) << dof_name(k) << ", " << bones()[j].end_joint;
  }
  for (int k = 0; k < model->shape_count(); ++k) {
    ShapeVector b = beta;
    b[k] += h;
    forward_kinematics(q, model->bone_vectors(b), up);
    b[k] -= 2 * h;
    forward_kinematics(q, model->bone_vectors(b), down);
    for (int j = 0; j < kJoints; ++j) EXPECT_LT((poser.joint_shape_derivative(j, k) - (up.joint.col(j) - down.joint.col(j)) / (2 * h)).norm(), 1e-8) << k;
  }
}

INSTANTIATE_TEST_SUITE_P(RandomPoses, Jacobian, testing::Range(0u, 6u));

TEST(Poser, AgreesWithTheModelsOwnPosing) {
  const auto model = tests::capsule_body();
  const ShapeVector beta = random_shape(3, model->shape_count());
  const PoseVector q = random_pose(3);
  Poser poser(*model, model->shape_count(), model->vertex_count());
  poser.set_shape(beta);
  poser.set_pose(q);
  Vertices expected;
  model->posed(beta, q, expected);
  for (int i = 0; i < poser.size(); ++i) EXPECT_LT((poser.position(i) - expected.col(poser.model_vertex(i))).norm(), 2e-6f);
}

}  // namespace
}  // namespace booth::fit

// Offsets that were put on a body come back: smooth, averaged, and only where something was seen.
#include "fit/detail/detail_layer.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "fit/body/poser.hpp"
#include "fit/estimator.hpp"
#include "fit/swarm/random.hpp"
#include "tests/support/allocation_count.hpp"
#include "tests/support/capsule_body.hpp"
#include "tests/support/posed_cloud.hpp"

namespace booth::fit {
namespace {

TEST(SurfaceSystem, SolvesWhatADenseSolverSolves) {
  Faces faces(3, 4);
  faces << 0, 0, 0, 1, 1, 2, 3, 3, 2, 3, 1, 2;
  SurfaceSystem system(faces, 4);
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(4, 4);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(4), d = Eigen::VectorXd::Zero(4);
  const Random random(3, 0);
  for (int i = 0; i < 30; ++i) {
    std::array<float, 3> a;
    for (std::uint32_t k = 0; k < 3; ++k) a[k] = 0.5f + 0.3f * Random::normal(random.words(static_cast<std::uint32_t>(i), k, 0));
    const float value = Random::normal(random.words(static_cast<std::uint32_t>(i), 9, 0)), weight = 1 + 0.1f * static_cast<float>(i);
    system.add(i % 4, a, value, weight);
    Eigen::VectorXd row = Eigen::VectorXd::Zero(4);
    for (int k = 0; k < 3; ++k) row[faces(k, i % 4)] = static_cast<double>(a[static_cast<std::size_t>(k)]);
    h += static_cast<double>(weight) * row * row.transpose();
    g += static_cast<double>(weight * value) * row;
  }
  EXPECT_NEAR(system.information(2), h(2, 2), 1e-4);
  const SurfaceSystem::Regularisation r{.step = 2, .size = 0.5};
  const Eigen::MatrixXd laplacian = 4 * Eigen::MatrixXd::Identity(4, 4) - Eigen::MatrixXd::Ones(4, 4);  // every vertex beside every other
  const Eigen::VectorXd expected = (h + r.step * laplacian + r.size * Eigen::MatrixXd::Identity(4, 4)).ldlt().solve(g);
  system.solve(r, 50, d);
  EXPECT_LT((d - expected).norm(), 1e-5 * expected.norm());
  system.scale(0.5);
  const Eigen::VectorXd halved = (0.5 * h + r.step * laplacian + r.size * Eigen::MatrixXd::Identity(4, 4)).ldlt().solve(0.5 * g);
  system.solve(r, 50, d);
  EXPECT_LT((d - halved).norm(), 1e-5 * halved.norm());
  system.reset();
  system.solve(r, 50, d);
  EXPECT_LT(d.norm(), 1e-6);
}

TEST(SurfaceSystem, RefusesFacesWithoutVertices) {
  Faces faces(3, 1);
  faces << 0, 1, 4;
  EXPECT_THROW(SurfaceSystem(faces, 4), std::invalid_argument);
}

/// A body with a smooth bulge, and its points.
class DetailLayerTest : public testing::Test {
 protected:
  std::shared_ptr<const BodyModel> model = tests::capsule_body();
  ShapeVector beta = ShapeVector::Zero(tests::kCapsuleShapes);
  PoseVector q = tests::pose_with({{"lhumerus_rz", 50}, {"rhumerus_rz", -40}, {"lfemur_rx", -25}, {"root_ry", 30}});
  Vertices rest, bulged, posed, normals;
  Eigen::VectorXd truth;

  void SetUp() override {
    model->shaped(beta, rest);
    truth.resize(model->vertex_count());
    for (int v = 0; v < model->vertex_count(); ++v) truth[v] = 0.012 + 0.010 * std::sin(6 * static_cast<double>(rest(1, v)));
    displace(rest, model->data().faces, truth, bulged);
    model->pose_mesh(bulged, model->rest_joints(beta), q, posed);
    vertex_normals(posed, model->data().faces, normals);
  }
  /// Ten points on each triangle, moved by normal noise along the normal; only those for which `keep` is true.
  template <typename Keep>
  Observation cloud(float noise, std::uint64_t seed, Keep keep) const {
    const Faces& faces = model->data().faces;
    Observation o(static_cast<int>(faces.cols()) * 10 + 1000);
    const Random random(seed, 0);
    for (Eigen::Index f = 0; f < faces.cols(); ++f)
      for (int i = 0; i < 10; ++i) {
        double u = std::fmod((i + 1) * 0.7548776662, 1.0), w = std::fmod((i + 1) * 0.5698402910, 1.0);
        if (u + w > 1) u = 1 - u, w = 1 - w;
        const Eigen::Vector3f a = posed.col(faces(0, f)), b = posed.col(faces(1, f)), c = posed.col(faces(2, f));
        const Eigen::Vector3f n = (b - a).cross(c - a).normalized();
        const float shift = noise * Random::normal(random.words(static_cast<std::uint32_t>(f), static_cast<std::uint32_t>(i), 0));
        const Eigen::Vector3f p = a + static_cast<float>(u) * (b - a) + static_cast<float>(w) * (c - a);
        if (keep(faces(0, f))) o.cloud.push(p + shift * n, n, 0);
      }
    return o;
  }
  Observation cloud(float noise = 0, std::uint64_t seed = 1) const {
    return cloud(noise, seed, [](int) { return true; });
  }
  /// Mean distance of the true surface's points to the layer's.
  double distance(DetailLayer& layer) const { return layer.distances(cloud().cloud, beta, q).mean; }
};

TEST_F(DetailLayerTest, FindsWhatWasPutOnTheBody) {
  DetailLayer layer(*model);
  EXPECT_GT(distance(layer), 0.008) << "without offsets it is as far away as the bulge";
  layer.fit(cloud(), beta, q);
  EXPECT_LT(distance(layer), 0.0015);
  double error = 0;
  for (int v = 0; v < model->vertex_count(); ++v) error += std::abs(layer.offsets()[v] - truth[v]) / model->vertex_count();
  EXPECT_LT(error, 0.003);
}

TEST_F(DetailLayerTest, FadesWhereNothingWasSeen) {
  const auto above = [&](int v) { return rest(1, v) > 0; };  // the root's height: trunk and arms
  DetailLayer layer(*model);
  layer.fit(cloud(0, 1, above), beta, q);
  const float foot = rest.row(1).minCoeff();
  int feet = 0, seen_above = 0, all_above = 0;
  for (int v = 0; v < model->vertex_count(); ++v) {
    if (rest(1, v) < foot + 0.1f) {
      ++feet;
      EXPECT_FALSE(layer.seen(v)) << v;
      EXPECT_LT(std::abs(layer.offsets()[v]), 0.002) << v;
    }
    if (rest(1, v) > 0.05f) ++all_above, seen_above += layer.seen(v);
  }
  EXPECT_GT(feet, 5);
  EXPECT_GT(seen_above, 0.9 * all_above);
}

TEST_F(DetailLayerTest, IsNotDraggedByPointsOfOtherThings) {
  Observation o = cloud();
  for (int i = 0; i < 900; ++i)  // a pole in front of the body
    o.cloud.push(Eigen::Vector3f(static_cast<float>(q[0]), 0.002f * static_cast<float>(i), static_cast<float>(q[2]) + 0.35f), Eigen::Vector3f::UnitZ(), 0);
  DetailLayer layer(*model);
  layer.fit(o, beta, q);
  EXPECT_LT(distance(layer), 0.002);
}

TEST_F(DetailLayerTest, AveragesNoiseOverMoments) {
  DetailLayer layer(*model);
  double first = 0;
  for (int i = 0; i < 24; ++i) {
    Observation o = cloud(0.012f, static_cast<std::uint64_t>(i + 1));
    o.time = i / 30.0;
    layer.add(o, beta, q);
    if (i == 0) first = distance(layer);
  }
  EXPECT_EQ(layer.moments(), 24);
  EXPECT_LT(distance(layer), 0.7 * first);
  EXPECT_LT(distance(layer), 0.003);
  layer.reset();
  EXPECT_EQ(layer.moments(), 0);
  EXPECT_EQ(layer.offsets().norm(), 0);
}

TEST_F(DetailLayerTest, FollowsTheBodyIntoAnotherPose) {
  DetailLayer layer(*model);
  layer.fit(cloud(), beta, q);
  q = tests::pose_with({{"lhumerus_rz", -30}, {"rhumerus_rz", 20}, {"rtibia_rx", 40}, {"root_ry", -60}});
  model->pose_mesh(bulged, model->rest_joints(beta), q, posed);
  EXPECT_LT(distance(layer), 0.0025);
}

TEST_F(DetailLayerTest, AllocatesNothingFromMomentToMoment) {
  if (!tests::AllocationCount::supported()) GTEST_SKIP() << "skipped: the sanitizer brings its own malloc";
  DetailLayer layer(*model);
  Observation o = cloud(0.005f);
  layer.add(o, beta, q);
  const tests::AllocationCount count;
  for (int i = 1; i < 4; ++i) {
    o.time = i / 30.0;
    layer.add(o, beta, q);
  }
  EXPECT_EQ(count.so_far(), 0u);
}

TEST_F(DetailLayerTest, AnEmptyCloudChangesNothing) {
  DetailLayer layer(*model);
  Observation empty(10);
  layer.fit(empty, beta, q);
  EXPECT_EQ(layer.offsets().norm(), 0);
  EXPECT_EQ(layer.distances(empty.cloud, beta, q).mean, 0);
}

}  // namespace
}  // namespace booth::fit

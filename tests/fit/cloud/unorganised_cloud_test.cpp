// Clouds from files: normals outwards, thinning, the largest piece, broken input.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "analytic_scene.hpp"
#include "fit/body/poser.hpp"
#include "fit/cloud/cloud_builder.hpp"
#include "tests/support/capsule_body.hpp"
#include "tests/support/posed_cloud.hpp"

namespace booth::fit {
namespace {

struct Sampled {
  Eigen::Matrix3Xf points, normals;
};

/// Points on the outer surface of a figure's capsules, evenly by area.
Sampled figure(int wanted, float noise, unsigned seed = 1) {
  tests::Scene scene;
  scene.add_person(0, 0);
  std::mt19937 random(seed);
  std::normal_distribution<float> gauss;
  std::vector<double> area;
  for (const auto& c : scene.capsules) area.push_back(c.radius * (2.0 * c.radius + (c.b - c.a).norm()));
  std::discrete_distribution<std::size_t> pick(area.begin(), area.end());
  std::uniform_real_distribution<float> uniform(0, 1);
  Sampled out{Eigen::Matrix3Xf(3, wanted), Eigen::Matrix3Xf(3, wanted)};
  for (int n = 0; n < wanted;) {
    const auto& c = scene.capsules[pick(random)];
    const Eigen::Vector3f axis = c.b - c.a;
    Eigen::Vector3f u = Eigen::Vector3f(gauss(random), gauss(random), gauss(random)).normalized();
    const float length = axis.norm(), s = uniform(random) * (length + 2 * c.radius) - c.radius;
    Eigen::Vector3f p;
    if (s > 0 && s < length) {
      u = (u - u.dot(axis) / (length * length) * axis).normalized();
      p = c.a + s / length * axis + c.radius * u;
    } else {
      if ((s <= 0) != (u.dot(axis) < 0)) u = -u;
      p = (s <= 0 ? c.a : c.b) + c.radius * u;
    }
    bool hidden = false;
    for (const auto& o : scene.capsules) {
      const float t = std::clamp((p - o.a).dot(o.b - o.a) / (o.b - o.a).squaredNorm(), 0.0f, 1.0f);
      hidden = hidden || (p - o.a - t * (o.b - o.a)).norm() < o.radius - 1e-4f;
    }
    if (hidden) continue;
    out.points.col(n) = p + noise * gauss(random) * u;
    out.normals.col(n++) = u;
  }
  return out;
}

double outward(const Cloud& cloud, const Sampled& truth) {
  double good = 0;
  int asked = 0;
  for (int i = 0; i < cloud.size; i += 1 + cloud.size / 2000, ++asked) {
    const auto k = static_cast<std::size_t>(i);
    Eigen::Index nearest = 0;
    (truth.points.colwise() - Eigen::Vector3f(cloud.x[k], cloud.y[k], cloud.z[k])).colwise().squaredNorm().minCoeff(&nearest);
    good += truth.normals.col(nearest).dot(Eigen::Vector3f(cloud.nx[k], cloud.ny[k], cloud.nz[k])) > 0.5f;
  }
  return good / asked;
}

TEST(UnorganisedCloud, NormalsOfAClosedCloudPointOutwards) {
  struct Case {
    int points;
    float noise;
    double good;  // within 60 degrees of the truth; of few points, those of forearms 7 cm thick are beyond repair
  };
  for (const Case& c : {Case{1500, 0, 0.75}, Case{4000, 0, 0.93}, Case{8000, 0.002f, 0.95}, Case{30000, 0.003f, 0.95}}) {
    const Sampled truth = figure(c.points, c.noise);
    Observation out(120000);
    CloudReport report;
    ASSERT_TRUE(build_unorganised(truth.points, {}, {}, {}, out, report));
    EXPECT_EQ(out.cloud.size, c.points);
    EXPECT_EQ(report.raw, c.points);
    EXPECT_TRUE(out.views.empty());
    EXPECT_GT(outward(out.cloud, truth), c.good) << c.points;
  }
}

/// Whether a closed mesh goes around p, by the solid angles of its triangles; parts of it may overlap.
bool enclosed(const Vertices& vertices, const Faces& faces, const Eigen::Vector3f& p) {
  double sum = 0;
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    const Eigen::Vector3f a = vertices.col(faces(0, f)) - p, b = vertices.col(faces(1, f)) - p, c = vertices.col(faces(2, f)) - p;
    const float x = a.norm(), y = b.norm(), z = c.norm();
    sum += 2 * std::atan2(a.dot(b.cross(c)), x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y);
  }
  return sum > 2 * 3.14159265358979;  // half of a full turn
}

/// Points all over a mesh, evenly by area, with isotropic noise (m) and the normals of their triangles; none where one part hides inside another,
/// because nothing measures such a surface.
Sampled sampled_mesh(const Vertices& vertices, const Faces& faces, int count, float noise) {
  std::vector<double> area;
  const auto cross = [&](Eigen::Index f) {
    const Eigen::Vector3f a = vertices.col(faces(0, f));
    return Eigen::Vector3f((vertices.col(faces(1, f)) - a).cross(vertices.col(faces(2, f)) - a));
  };
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    const Eigen::Vector3f middle = (vertices.col(faces(0, f)) + vertices.col(faces(1, f)) + vertices.col(faces(2, f))) / 3;
    area.push_back(enclosed(vertices, faces, middle + 0.004f * cross(f).normalized()) ? 0.0 : cross(f).norm());
  }
  std::mt19937 random(5);
  std::discrete_distribution<Eigen::Index> pick(area.begin(), area.end());
  std::uniform_real_distribution<float> uniform(0, 1);
  std::normal_distribution<float> gauss(0, noise);
  Sampled out{Eigen::Matrix3Xf(3, count), Eigen::Matrix3Xf(3, count)};
  for (int i = 0; i < count; ++i) {
    const Eigen::Index f = pick(random);
    float u = uniform(random), v = uniform(random);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Eigen::Vector3f a = vertices.col(faces(0, f)), b = vertices.col(faces(1, f)), c = vertices.col(faces(2, f));
    out.points.col(i) = a + u * (b - a) + v * (c - a) + Eigen::Vector3f(gauss(random), gauss(random), gauss(random));
    out.normals.col(i) = cross(f).normalized();
  }
  return out;
}

// A crease or a touch of two limbs once turned everything that hung on it.
TEST(UnorganisedCloud, FewNormalsOfANoisyBodyPointInwards) {
  const auto body = tests::capsule_body();
  for (const PoseVector& q : {body->rest_pose(), tests::pose_with({})}) {
    Vertices vertices;
    body->posed(ShapeVector::Zero(body->shape_count()), q, vertices);
    const Sampled truth = sampled_mesh(vertices, body->data().faces, 40000, 0.003f);
    Observation out(120000);
    CloudReport report;
    ASSERT_TRUE(build_unorganised(truth.points, {}, {}, {}, out, report));
    ASSERT_EQ(out.cloud.size, truth.points.cols());
    int known = 0, inwards = 0;
    for (int i = 0; i < out.cloud.size; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const Eigen::Vector3f n(out.cloud.nx[k], out.cloud.ny[k], out.cloud.nz[k]);
      known += !n.isZero();
      inwards += n.dot(truth.normals.col(i)) < -0.5f;
    }
    EXPECT_GT(known, 0.9 * out.cloud.size);
    EXPECT_LT(inwards, 0.03 * out.cloud.size);
  }
}

TEST(UnorganisedCloud, NormalsOfOneViewPointToTheViewpoint) {
  tests::Scene scene;
  scene.add_person(0, 0);
  const auto rig = tests::booth_cameras(1);
  const tests::BoothFrame frame(scene, rig);
  CloudBuilder builder({}, rig);
  Observation seen = builder.make_observation(120000);
  CloudReport report;
  ASSERT_TRUE(builder.build(frame.inputs, seen, report));
  Eigen::Matrix3Xf points(3, seen.cloud.size);
  for (int i = 0; i < seen.cloud.size; ++i)
    points.col(i) =
        Eigen::Vector3f(seen.cloud.x[static_cast<std::size_t>(i)], seen.cloud.y[static_cast<std::size_t>(i)], seen.cloud.z[static_cast<std::size_t>(i)]);
  const Eigen::Vector3f eye[] = {rig[0].centre()};
  Observation out(120000);
  ASSERT_TRUE(build_unorganised(points, {}, eye, {}, out, report));
  double towards = 0, known = 0;
  for (int i = 0; i < out.cloud.size; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Eigen::Vector3f n(out.cloud.nx[k], out.cloud.ny[k], out.cloud.nz[k]), p(out.cloud.x[k], out.cloud.y[k], out.cloud.z[k]);
    if (n.isZero()) continue;
    ++known;
    towards += n.dot(eye[0] - p) > 0;
  }
  EXPECT_GT(known / out.cloud.size, 0.95);
  EXPECT_GT(towards / known, 0.95);
}

TEST(UnorganisedCloud, GivenNormalsAreKeptAndNormalised) {
  Sampled truth = figure(500, 0);
  truth.normals *= 3;
  truth.normals.col(7).setConstant(std::nanf(""));
  Observation out(1000);
  CloudReport report;
  ASSERT_TRUE(build_unorganised(truth.points, truth.normals, {}, {}, out, report));
  for (int i = 0; i < 500; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Eigen::Vector3f n(out.cloud.nx[k], out.cloud.ny[k], out.cloud.nz[k]);
    if (i == 7) {
      EXPECT_TRUE(n.isZero());
    } else {
      EXPECT_LT((n - truth.normals.col(i) / 3).norm(), 1e-5f);
    }
  }
}

TEST(UnorganisedCloud, ThinsToAnEvenSpacingWithinTheCapacity) {
  const Sampled truth = figure(20000, 0);
  Observation out(2000);
  CloudReport report;
  ASSERT_TRUE(build_unorganised(truth.points, truth.normals, {}, {}, out, report));
  EXPECT_LE(out.cloud.size, 2000);
  EXPECT_GT(out.cloud.size, 1400);
  // No place of the figure is left without a point.
  double farthest = 0;
  for (int i = 0; i < 20000; i += 13) {
    float best = 10;
    for (int j = 0; j < out.cloud.size; ++j) {
      const auto k = static_cast<std::size_t>(j);
      best = std::min(best, (truth.points.col(i) - Eigen::Vector3f(out.cloud.x[k], out.cloud.y[k], out.cloud.z[k])).norm());
    }
    farthest = std::max<double>(farthest, best);
  }
  EXPECT_LT(farthest, 0.08);
}

TEST(UnorganisedCloud, TheLargestPieceOnly) {
  const Sampled truth = figure(4000, 0);
  Eigen::Matrix3Xf points(3, 4300);
  points.leftCols(4000) = truth.points;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(0, 0.2f);
  for (int i = 4000; i < 4300; ++i) points.col(i) = Eigen::Vector3f(1.0f + uniform(random), uniform(random), uniform(random));
  Observation out(10000);
  CloudReport report;
  ASSERT_TRUE(build_unorganised(points, {}, {}, {.largest_component = true}, out, report));
  EXPECT_EQ(report.other, 300);
  EXPECT_EQ(report.person, 4000);
  for (int i = 0; i < out.cloud.size; ++i) ASSERT_LT(out.cloud.x[static_cast<std::size_t>(i)], 0.99f);
  ASSERT_TRUE(build_unorganised(points, {}, {}, {}, out, report));
  EXPECT_EQ(report.points, 4300);
}

TEST(UnorganisedCloud, BrokenInputIsRefusedOrLeftOut) {
  const float nan = std::nanf(""), inf = std::numeric_limits<float>::infinity(), huge = std::numeric_limits<float>::max();
  Observation out(100);
  CloudReport report;
  EXPECT_FALSE(build_unorganised({}, {}, {}, {}, out, report));
  EXPECT_EQ(report.outcome, CloudOutcome::no_measurement);
  Eigen::Matrix3Xf broken(3, 4);
  broken << nan, inf, 0, huge, 0, 0, -inf, huge, 0, 0, 0, 1;
  EXPECT_FALSE(build_unorganised(broken, {}, {}, {}, out, report));
  EXPECT_EQ(report.outcome, CloudOutcome::no_measurement);
  broken.col(1) = Eigen::Vector3f(1, 2, 3);
  ASSERT_TRUE(build_unorganised(broken, {}, {}, {}, out, report));
  EXPECT_EQ(out.cloud.size, 1);
  EXPECT_EQ(out.cloud.nx[0], 0) << "one point has no normal";
  EXPECT_THROW(build_unorganised(broken, Eigen::Matrix3Xf(3, 2), {}, {}, out, report), std::invalid_argument);
  // The same point many times over, and more of it than the cloud holds.
  ASSERT_TRUE(build_unorganised(Eigen::Matrix3Xf::Constant(3, 5000, 0.5f), {}, {}, {.largest_component = true}, out, report));
  EXPECT_GE(out.cloud.size, 1);
  EXPECT_LE(out.cloud.size, 100);
}

}  // namespace
}  // namespace booth::fit

// The field of cells against brute force: how far from the truth one look-up is, what it does at its borders, and that nothing moves its bits.
#include "fit/cloud/cell_field.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "analytic_scene.hpp"
#include "fit/swarm/lanes.hpp"
#include "tests/support/allocation_count.hpp"

namespace booth::fit {
namespace {

/// A figure seen by four cameras.
const Cloud& person_cloud() {
  static const Observation made = [] {
    tests::Scene scene;
    scene.add_person(0.1f, -0.2f);
    scene.noise = 0.003f;
    const auto rig = tests::booth_cameras();
    const tests::BoothFrame frame(scene, rig);
    CloudBuilder builder({}, rig);
    Observation out = builder.make_observation(60000);
    CloudReport report;
    builder.build(frame.inputs, out, report);
    return out;
  }();
  return made.cloud;
}

constexpr double kMeanBound = 0.0015, kNearBound = 0.0017;  // m; docs/design/cloud.md has the figures by distance

Eigen::Vector3f point(const Cloud& cloud, int i) {
  const auto k = static_cast<std::size_t>(i);
  return {cloud.x[k], cloud.y[k], cloud.z[k]};
}

float brute(const Cloud& cloud, const Eigen::Vector3f& p) {
  float best = std::numeric_limits<float>::infinity();
  for (int i = 0; i < cloud.size; ++i) best = std::min(best, (point(cloud, i) - p).squaredNorm());
  return std::sqrt(best);
}

TEST(CellField, OneLookUpIsAMillimetreOrTwoFromBruteForceEverywhereInTheBand) {
  const Cloud& cloud = person_cloud();
  CellField field;
  WorkerPool pool(2);
  field.rebuild(cloud, pool);
  std::mt19937 random(3);
  std::uniform_int_distribution<int> pick(0, cloud.size - 1);
  std::normal_distribution<float> gauss;
  std::uniform_real_distribution<float> distance(0, 0.29f);
  double sum = 0, near = 0;
  int asked = 0, of_near = 0;
  for (int k = 0; k < 4000; ++k) {
    const Eigen::Vector3f p = point(cloud, pick(random)) + distance(random) * Eigen::Vector3f(gauss(random), gauss(random), gauss(random)).normalized();
    const float truth = brute(cloud, p);
    if (truth > 0.28f) continue;
    Eigen::Vector3f found;
    ASSERT_TRUE(field.nearest(p, found)) << "inside the band there is always an answer";
    const double error = static_cast<double>(std::abs((found - p).norm() - truth));
    EXPECT_LT(error, 0.06) << truth;
    sum += error, ++asked;
    if (truth < 0.06f) near += error, ++of_near;
  }
  ASSERT_GT(asked, 3000);
  ASSERT_GT(of_near, 1000);
  RecordProperty("mean_micrometres", static_cast<int>(1e6 * sum / asked));
  RecordProperty("mean_micrometres_within_6_cm", static_cast<int>(1e6 * near / of_near));
  EXPECT_LT(sum / asked, kMeanBound);
  EXPECT_LT(near / of_near, kNearBound);
}

TEST(CellField, NothingBeyondTheBandAndNothingFromBrokenNumbers) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  WorkerPool pool(2);
  CellField field;
  Eigen::Vector3f found;
  EXPECT_FALSE(field.nearest({0, 0, 0}, found)) << "before any cloud";
  Cloud cloud(10);
  cloud.push({nan, 0, 0}, Eigen::Vector3f::Zero(), 0);
  cloud.push({0, inf, 0}, Eigen::Vector3f::Zero(), 0);
  cloud.push({0, 0, 1e20f}, Eigen::Vector3f::Zero(), 0);
  field.rebuild(cloud, pool);
  EXPECT_FALSE(field.nearest({0, 0, 0}, found)) << "no point of the cloud is one";
  cloud.push({1, 2, 3}, Eigen::Vector3f::Zero(), 0);
  field.rebuild(cloud, pool);
  ASSERT_TRUE(field.nearest({1.01f, 2, 3}, found));
  EXPECT_LT((found - Eigen::Vector3f(1, 2, 3)).norm(), 0.001f);
  ASSERT_TRUE(field.nearest({1, 2.28f, 3}, found));
  EXPECT_LT((found - Eigen::Vector3f(1, 2, 3)).norm(), 0.001f);
  for (float far : {0.45f, 5.0f, 1e10f, inf, nan})
    for (int axis = 0; axis < 3; ++axis)
      for (float sign : {-1.0f, 1.0f}) {
        Eigen::Vector3f p(1, 2, 3);
        p[axis] += sign * far;
        EXPECT_FALSE(field.nearest(p, found)) << far << " " << axis;
      }
}

TEST(CellField, ACloudThatIsTooLargeGetsLargerCellsAndOneThatIsDenseEverywhereIsAnsweredEverywhere) {
  Cloud cloud(20000);
  std::mt19937 random(4);
  std::uniform_real_distribution<float> uniform(-4, 4);
  while (cloud.size < 2000) cloud.push({uniform(random), uniform(random), uniform(random)}, Eigen::Vector3f::Zero(), 0);
  WorkerPool pool(1);
  CellField small({.max_bricks = 8192});
  small.rebuild(cloud, pool);
  EXPECT_GT(small.view().cell_size, 0.0125f);
  EXPECT_LE(small.cells(), 8192 * 64);
  Eigen::Vector3f found;
  int answered = 0;
  for (int i = 0; i < cloud.size; ++i) answered += small.nearest(point(cloud, i), found);
  EXPECT_EQ(answered, cloud.size);

  // A cubic metre full of points.
  std::uniform_real_distribution<float> box(0, 1);
  cloud.clear();
  while (cloud.size < 20000) cloud.push({box(random), box(random), box(random)}, Eigen::Vector3f::Zero(), 0);
  CellField field;
  field.rebuild(cloud, pool);
  answered = 0;
  for (int i = 0; i < cloud.size; ++i) answered += field.nearest(point(cloud, i), found) && (found - point(cloud, i)).norm() < 0.03f;
  EXPECT_EQ(answered, cloud.size);
}

// Every answer is a point of the cloud: what spreads is never made up on the way.
TEST(CellField, AnswersWithPointsOfTheCloudAfterAnyNumberOfClouds) {
  const Cloud& person = person_cloud();
  Cloud other(300);
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-0.5f, 0.5f);
  while (other.size < 300) other.push({uniform(random), 1 + uniform(random), uniform(random)}, Eigen::Vector3f::Zero(), 0);
  WorkerPool pool(2);
  CellField field;
  field.rebuild(person, pool);
  field.rebuild(other, pool);
  for (int k = 0; k < 3000; ++k) {
    const Eigen::Vector3f p(1.4f * uniform(random), 1 + 1.4f * uniform(random), 1.4f * uniform(random));
    Eigen::Vector3f found;
    if (field.nearest(p, found)) {
      EXPECT_LT(brute(other, found), 0.001f);
    }
  }
}

TEST(CellField, SaysWhichSettingIsWrong) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(CellField({.band = nan}), std::invalid_argument);
  EXPECT_THROW(CellField({.cell = 0}), std::invalid_argument);
  EXPECT_THROW(CellField({.cell = 0.01f}), std::invalid_argument);
  EXPECT_THROW(CellField({.fine = 1}), std::invalid_argument);
  EXPECT_THROW(CellField({.max_points = 0}), std::invalid_argument);
  EXPECT_THROW(CellField({.max_bricks = 5}), std::invalid_argument);
  EXPECT_THROW(CellField({.max_points = 200'000}), std::invalid_argument);
}

TEST(CellField, TheSameForAnyNumberOfThreadsAndAllocatesNothing) {
  const Cloud& cloud = person_cloud();
  CellField reference;
  WorkerPool one(1);
  reference.rebuild(cloud, one);
  for (int threads : {2, 4}) {
    WorkerPool pool(threads);
    CellField field;
    field.rebuild(cloud, pool);
    const tests::AllocationCount guard;
    field.rebuild(cloud, pool);
    EXPECT_EQ(guard.so_far(), 0u);
    ASSERT_EQ(field.cells(), reference.cells());
    EXPECT_TRUE(std::equal(field.words(), field.words() + field.cells(), reference.words()));
  }
}

}  // namespace
}  // namespace booth::fit

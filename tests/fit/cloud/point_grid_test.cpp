// The grid's answers are the brute-force answers, for every kind of cloud and query.
#include "fit/cloud/point_grid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "tests/support/allocation_count.hpp"

namespace booth::fit {
namespace {

struct Points {
  std::vector<float> x, y, z, nx, ny, nz;
  int size() const { return static_cast<int>(x.size()); }
  Eigen::Vector3f at(int i) const { return {x[static_cast<std::size_t>(i)], y[static_cast<std::size_t>(i)], z[static_cast<std::size_t>(i)]}; }
  Eigen::Vector3f normal(int i) const { return {nx[static_cast<std::size_t>(i)], ny[static_cast<std::size_t>(i)], nz[static_cast<std::size_t>(i)]}; }
  void add(const Eigen::Vector3f& p, const Eigen::Vector3f& n) {
    x.push_back(p.x()), y.push_back(p.y()), z.push_back(p.z());
    nx.push_back(n.x()), ny.push_back(n.y()), nz.push_back(n.z());
  }
};

Eigen::Vector3f random_unit(std::mt19937& random) {
  std::normal_distribution<float> gauss;
  return Eigen::Vector3f(gauss(random), gauss(random), gauss(random)).normalized();
}

Points body_like(std::mt19937& random, int n) {  // the surface of an upright ellipsoid
  Points out;
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3f u = random_unit(random);
    out.add(u.cwiseProduct(Eigen::Vector3f(0.3f, 0.9f, 0.2f)) + Eigen::Vector3f(0.4f, 0.9f, -0.2f), u);
  }
  return out;
}

/// Distance of the nearest point within reach, infinity when there is none.
float brute(const Points& points, const Eigen::Vector3f& p, float reach, const Eigen::Vector3f* normal = nullptr, float cosine = -2) {
  float best = std::numeric_limits<float>::infinity();
  for (int i = 0; i < points.size(); ++i) {
    const float d = (points.at(i) - p).norm();
    if (std::isfinite(d) && d < reach && (!normal || points.normal(i).dot(*normal) > cosine)) best = std::min(best, d);
  }
  return best;
}

void expect_exact(const Points& points, const PointGrid& grid, const Eigen::Vector3f& p, float reach) {
  const int found = grid.nearest(p, reach);
  const float truth = brute(points, p, reach);
  if (found < 0) {
    EXPECT_TRUE(truth > reach * (1 - 1e-5f)) << truth << " of " << reach;
  } else {
    EXPECT_NEAR((points.at(found) - p).norm(), truth, 1e-6f);
  }
}

TEST(PointGrid, AgreesWithBruteForceInsideAndOutside) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(-1.5f, 2.5f), reaches(0.01f, 1.5f);
  for (int round = 0; round < 40; ++round) {
    const Points points = body_like(random, 1 + round * 60);
    PointGrid grid(points.size(), round % 3 == 0 ? 0.0f : 0.02f * static_cast<float>(round % 3));
    grid.rebuild(points.x.data(), points.y.data(), points.z.data(), points.size());
    for (int k = 0; k < 50; ++k) expect_exact(points, grid, {uniform(random), uniform(random), uniform(random)}, reaches(random));
    for (int k = 0; k < 50; ++k) expect_exact(points, grid, points.at(k % points.size()) + 0.02f * random_unit(random), 0.1f);
  }
}

TEST(PointGrid, NormalGateAgreesWithBruteForce) {
  std::mt19937 random(2);
  const Points points = body_like(random, 2000);
  PointGrid grid(2000);
  grid.rebuild(points.x.data(), points.y.data(), points.z.data(), points.nx.data(), points.ny.data(), points.nz.data(), points.size());
  int gated_away = 0;
  for (int k = 0; k < 500; ++k) {
    const Eigen::Vector3f p = points.at(k) + 0.05f * random_unit(random), n = random_unit(random);
    const int found = grid.nearest(p, 0.3f, n, 0.5f);
    const float truth = brute(points, p, 0.3f, &n, 0.5f);
    if (found < 0) {
      EXPECT_FALSE(truth < 0.2999f);
      ++gated_away;
    } else {
      EXPECT_GT(points.normal(found).dot(n), 0.5f);
      EXPECT_NEAR((points.at(found) - p).norm(), truth, 1e-6f);
    }
  }
  EXPECT_GT(gated_away, 50);
  grid.rebuild(points.x.data(), points.y.data(), points.z.data(), points.size());
  EXPECT_EQ(grid.nearest(points.at(0), 1, Eigen::Vector3f::UnitX(), -1), -1) << "without normals there is nothing to compare";
}

TEST(PointGrid, SurvivesHostileNumbers) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity(), huge = std::numeric_limits<float>::max();
  Points points;
  points.add({nan, 0, 0}, Eigen::Vector3f::UnitX());
  points.add({0, inf, 0}, Eigen::Vector3f::UnitX());
  PointGrid grid(10);
  EXPECT_EQ(grid.nearest({0, 0, 0}, 1), -1) << "before the first rebuild";
  grid.rebuild(points.x.data(), points.y.data(), points.z.data(), points.size());
  EXPECT_EQ(grid.nearest({0, 0, 0}, 1), -1);
  points.add({1, 2, 3}, Eigen::Vector3f::UnitX());
  grid.rebuild(points.x.data(), points.y.data(), points.z.data(), points.size());
  EXPECT_EQ(grid.nearest({1, 2, 3.1f}, 1), 2);
  EXPECT_EQ(grid.nearest({nan, 2, 3}, 1), -1);
  EXPECT_EQ(grid.nearest({huge, -huge, inf}, 1), -1);
  EXPECT_EQ(grid.nearest({1, 2, 3}, nan), -1);
  EXPECT_EQ(grid.nearest({1, 2, 3}, 0), -1);
  EXPECT_EQ(grid.nearest({1, 2, 3}, inf), 2);
  points.add({999, -999, 999}, Eigen::Vector3f::UnitX());
  points.add({huge, huge, -huge}, Eigen::Vector3f::UnitX());
  grid.rebuild(points.x.data(), points.y.data(), points.z.data(), points.size());
  EXPECT_EQ(grid.nearest({1, 2, 3}, 1), 2);
  EXPECT_EQ(grid.nearest({999, -999, 999}, 1), 3);
}

TEST(PointGrid, TakesNoMoreThanItsCapacityAndAllocatesNothing) {
  std::mt19937 random(3);
  const Points points = body_like(random, 3000);
  PointGrid grid(1000);
  const tests::AllocationCount guard;
  grid.rebuild(points.x.data(), points.y.data(), points.z.data(), points.size());
  int highest = -1;
  for (int i = 0; i < points.size(); ++i) highest = std::max(highest, grid.nearest(points.at(i), 0.5f));
  EXPECT_EQ(guard.so_far(), 0u);
  EXPECT_EQ(highest, 999);
  EXPECT_THROW(PointGrid(0), std::invalid_argument);
  EXPECT_THROW(PointGrid(10, -1), std::invalid_argument);
}

}  // namespace
}  // namespace booth::fit

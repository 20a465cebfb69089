// A floor is taken for a floor, and feet, backs and boxes are not.
#include "fit/cloud/scan_floor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/support/capsule_body.hpp"
#include "tests/support/posed_cloud.hpp"

namespace booth::fit {
namespace {

Eigen::Matrix3Xf person(const PoseVector& q) {
  const auto model = tests::capsule_body();
  const Observation o = tests::posed_cloud(*model, ShapeVector::Zero(1), q);
  Eigen::Matrix3Xf out(3, o.cloud.size);
  for (int i = 0; i < o.cloud.size; ++i)
    out.col(i) << o.cloud.x[static_cast<std::size_t>(i)], o.cloud.y[static_cast<std::size_t>(i)], o.cloud.z[static_cast<std::size_t>(i)];
  out.row(1).array() -= out.row(1).minCoeff();
  return out;
}

Eigen::Matrix3Xf with_floor(const Eigen::Matrix3Xf& points, float size, float tilt, float noise) {
  constexpr Eigen::Index kCount = 4000;
  Eigen::Matrix3Xf out(3, points.cols() + kCount);
  out.leftCols(points.cols()) = points;
  const Eigen::Vector3f middle = points.rowwise().mean();
  for (Eigen::Index i = 0; i < kCount; ++i) {
    const auto number = static_cast<double>(i + 1);
    const float u = static_cast<float>(std::fmod(number * 0.7548776662, 1.0)) - 0.5f, v = static_cast<float>(std::fmod(number * 0.5698402910, 1.0)) - 0.5f;
    const float w = static_cast<float>(std::fmod(number * 0.3819660113, 1.0)) - 0.5f;
    out.col(points.cols() + i) << middle.x() + size * u, tilt * size * u + 2 * noise * w, middle.z() + size * v;
  }
  return out;
}

TEST(ScanFloor, IsFoundUnderAPerson) {
  const Eigen::Matrix3Xf standing = person(tests::pose_with({}));
  for (const float tilt : {0.0f, 0.04f}) {
    const Eigen::Matrix3Xf scan = with_floor(standing, 2, tilt, 0.006f);
    const ScanFloor floor = find_scan_floor(scan);
    ASSERT_TRUE(floor.found) << tilt;
    EXPECT_NEAR(floor.height, 0, 0.01f);
    EXPECT_NEAR(floor.tilt_x, tilt, 0.01f);
    int left = 0, taken = 0;
    for (Eigen::Index i = 0; i < scan.cols(); ++i)
      (i < standing.cols() ? left : taken) += i < standing.cols() ? floor.above[static_cast<std::size_t>(i)] : floor.above[static_cast<std::size_t>(i)] == 0;
    EXPECT_GT(left, 0.93 * static_cast<double>(standing.cols())) << "soles go with the floor, the body stays";
    EXPECT_EQ(taken, scan.cols() - standing.cols());
  }
}

TEST(ScanFloor, IsNotMadeOfAPerson) {
  EXPECT_FALSE(find_scan_floor(person(tests::pose_with({}))).found);
  EXPECT_FALSE(find_scan_floor(person(tests::pose_with({{"root_rx", -90}}))).found) << "lying on the back";
  EXPECT_FALSE(find_scan_floor(person(tests::pose_with({{"lfemur_rx", -90}, {"rfemur_rx", -90}, {"ltibia_rx", 100}, {"rtibia_rx", 100}}))).found);
}

TEST(ScanFloor, ASmallPlatformIsNoFloorAndNothingIsNothing) {
  EXPECT_FALSE(find_scan_floor(with_floor(person(tests::pose_with({})), 0.35f, 0, 0.003f)).found);
  EXPECT_FALSE(find_scan_floor(Eigen::Matrix3Xf(3, 0)).found);
  EXPECT_FALSE(find_scan_floor(Eigen::Matrix3Xf::Constant(3, 500, std::numeric_limits<float>::quiet_NaN())).found);
}

}  // namespace
}  // namespace booth::fit

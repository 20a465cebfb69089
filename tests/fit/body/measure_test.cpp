// Measures of a body of known size: an upright elliptic column stands for the trunk.
#include "fit/body/measure.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace booth::fit {
namespace {

constexpr int kRings = 41, kSides = 64;
constexpr double kPi = 3.14159265358979323846, kHeight = 1.8, kHalfWidth = 0.2, kHalfDepth = 0.1;

int vertex(int ring, int side) { return ring * kSides + (side + kSides) % kSides; }

/// A closed column of elliptic section; vertex (ring, side) lies at angle 2 pi side / kSides from +x.
BodyModelData column(double dent = 0) {
  BodyModelData d;
  const int count = kRings * kSides + 2;
  d.mean.resize(3, count);
  d.mirror_vertex.resize(count);
  for (int r = 0; r < kRings; ++r)
    for (int s = 0; s < kSides; ++s) {
      const double turn = 2 * kPi * s / kSides;
      double z = kHalfDepth * std::sin(turn);
      if (s == kSides / 4) z -= dent;  // a hollow along the front
      d.mean.col(vertex(r, s)) = Eigen::Vector3d(kHalfWidth * std::cos(turn), kHeight * r / (kRings - 1), z).cast<float>();
      d.mirror_vertex[vertex(r, s)] = vertex(r, kSides / 2 - s);
    }
  const int bottom = count - 2, top = count - 1;
  d.mean.col(bottom) = Eigen::Vector3f(0, 0, 0);
  d.mean.col(top) = Eigen::Vector3f(0, static_cast<float>(kHeight), 0);
  d.mirror_vertex[bottom] = bottom;
  d.mirror_vertex[top] = top;
  std::vector<Eigen::Vector3i> faces;
  for (int s = 0; s < kSides; ++s) {
    for (int r = 0; r + 1 < kRings; ++r) {
      faces.emplace_back(vertex(r, s), vertex(r + 1, s), vertex(r + 1, s + 1));
      faces.emplace_back(vertex(r, s), vertex(r + 1, s + 1), vertex(r, s + 1));
    }
    faces.emplace_back(bottom, vertex(0, s), vertex(0, s + 1));
    faces.emplace_back(top, vertex(kRings - 1, s + 1), vertex(kRings - 1, s));
  }
  d.faces.resize(3, static_cast<Eigen::Index>(faces.size()));
  for (std::size_t f = 0; f < faces.size(); ++f) d.faces.col(static_cast<Eigen::Index>(f)) = faces[f];
  d.skin_bone.setZero(kSkinBones, count);
  d.skin_weight.setZero(kSkinBones, count);
  d.skin_weight.row(0).setOnes();
  d.landmarks.resize(kLandmarks);
  d.landmarks << vertex(30, 10), vertex(24, 16), vertex(20, 48), vertex(18, 16), vertex(36, 4), vertex(19, 2);
  return d;
}

double of(const MeasureValues& m, Measure which) { return m[static_cast<std::size_t>(which)]; }

double ellipse_girth() {
  double length = 0;
  for (int s = 0; s < kSides; ++s) {
    const double a = 2 * kPi * s / kSides, b = 2 * kPi * (s + 1) / kSides;
    length += std::hypot(kHalfWidth * (std::cos(a) - std::cos(b)), kHalfDepth * (std::sin(a) - std::sin(b)));
  }
  return length;
}

TEST(Measure, ColumnHasTheSizesThatItWasBuiltWith) {
  const auto data = column();
  const auto m = Measurer(data).measure(data.mean, Points3::Zero());
  EXPECT_NEAR(of(m, Measure::stature), kHeight, 1e-6);
  EXPECT_NEAR(of(m, Measure::chest_girth), ellipse_girth(), 1e-3);
  EXPECT_NEAR(of(m, Measure::waist_girth), ellipse_girth(), 1e-3);
  const double section = 0.5 * kSides * std::sin(2 * kPi / kSides) * kHalfWidth * kHalfDepth;
  EXPECT_NEAR(of(m, Measure::volume), section * kHeight, 1e-5);
  EXPECT_NEAR(of(m, Measure::mass), of(m, Measure::volume) * kBodyDensity, 1e-9);
  EXPECT_NEAR(of(m, Measure::crotch_height), kHeight * 18 / (kRings - 1), 1e-6);
  EXPECT_NEAR(of(m, Measure::shoulder_breadth), 2 * kHalfWidth * std::cos(2 * kPi * 4 / kSides), 1e-6);
}

TEST(Measure, TapeDoesNotFollowHollows) {
  const auto smooth = column(), dented = column(0.03);
  const auto a = Measurer(smooth).measure(smooth.mean, Points3::Zero()), b = Measurer(dented).measure(dented.mean, Points3::Zero());
  EXPECT_NEAR(of(a, Measure::chest_girth), of(b, Measure::chest_girth), 2e-3);
  EXPECT_LT(of(b, Measure::volume), of(a, Measure::volume));
}

TEST(Measure, ScalesWithTheBody) {
  const auto data = column();
  const Measurer measurer(data);
  const Vertices larger = 1.1f * data.mean;
  const auto a = measurer.measure(data.mean, Points3::Zero()), b = measurer.measure(larger, Points3::Zero());
  EXPECT_NEAR(of(b, Measure::stature), 1.1 * of(a, Measure::stature), 1e-5);
  EXPECT_NEAR(of(b, Measure::waist_girth), 1.1 * of(a, Measure::waist_girth), 1e-3);
  EXPECT_NEAR(of(b, Measure::volume), 1.331 * of(a, Measure::volume), 1e-5);
}

TEST(Measure, ArmsAreNotMeasuredWithTheChest) {
  auto data = column();
  const auto before = Measurer(data).measure(data.mean, Points3::Zero());
  // The outermost sides become arm: what is left is narrower.
  for (int r = 0; r < kRings; ++r)
    for (int s : {-2, -1, 0, 1, 2, kSides / 2 - 2, kSides / 2 - 1, kSides / 2, kSides / 2 + 1, kSides / 2 + 2})
      data.skin_bone(0, vertex(r, s)) = static_cast<std::uint8_t>(bone_index("lhumerus"));
  const auto after = Measurer(data).measure(data.mean, Points3::Zero());
  EXPECT_LT(of(after, Measure::chest_girth), of(before, Measure::chest_girth) - 0.005);
}

TEST(Measure, CalibrationHasAnInverse) {
  for (int m = 0; m < kMeasures; ++m)
    EXPECT_NEAR(propagated_variance_of(static_cast<Measure>(m), calibrated_measure_sd(static_cast<Measure>(m), 4e-4)), 4e-4, 1e-9);
}

TEST(Measure, ModelWithoutLandmarksIsRefused) {
  auto data = column();
  data.landmarks.resize(0);
  EXPECT_THROW(Measurer{data}, std::invalid_argument);
  data = column();
  data.landmarks[2] = 1000000;
  EXPECT_THROW(Measurer{data}, std::invalid_argument);
}

}  // namespace
}  // namespace booth::fit

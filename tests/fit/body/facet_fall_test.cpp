// How far flat facets lie below tangent planes, on a solid where it is known.
#include "fit/body/facet_fall.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace booth::fit {
namespace {

BodyModelData icosahedron(float radius, float sign) {
  constexpr float g = std::numbers::phi_v<float>;
  BodyModelData data;
  data.mean.resize(3, 12);
  int n = 0;
  for (const float a : {-1.0f, 1.0f})
    for (const float b : {-g, g}) data.mean.col(n++) << 0, a, b, data.mean.col(n++) << a, b, 0, data.mean.col(n++) << b, 0, a;
  data.faces.resize(3, 20);
  int faces = 0;
  for (int i = 0; i < 12; ++i)
    for (int j = i + 1; j < 12; ++j)
      for (int k = j + 1; k < 12; ++k) {
        const Eigen::Vector3f a = data.mean.col(i), b = data.mean.col(j), c = data.mean.col(k);
        if ((a - b).norm() > 2.1f || (b - c).norm() > 2.1f || (c - a).norm() > 2.1f) continue;
        const bool outwards = sign * (b - a).cross(c - a).dot(a) > 0;
        data.faces.col(faces++) << i, outwards ? j : k, outwards ? k : j;
      }
  EXPECT_EQ(faces, 20);
  data.mean *= radius / data.mean.col(0).norm();
  return data;
}

TEST(FacetFall, OfAnIcosahedronIsItsGoldenSlopeWhateverItsSizeAndNegativeFromWithin) {
  const float slope = 1 / std::numbers::phi_v<float>;
  for (const float radius : {0.1f, 2.0f})
    for (const float sign : {1.0f, -1.0f}) {
      const std::vector<float> fall = facet_fall(icosahedron(radius, sign));
      ASSERT_EQ(fall.size(), 12u);
      for (const float f : fall) EXPECT_NEAR(f, sign * slope, 1e-4f);
    }
}

TEST(FacetFall, OfAFlatPieceAndOfALooseVertexIsNothing) {
  BodyModelData data;
  data.mean.resize(3, 5);
  data.mean << 0, 1, 1, 0, 9, 0, 0, 1, 1, 9, 0, 0, 0, 0, 9;
  data.faces.resize(3, 2);
  data.faces << 0, 0, 1, 2, 2, 3;
  for (const float f : facet_fall(data)) EXPECT_NEAR(f, 0, 1e-6f);
}

}  // namespace
}  // namespace booth::fit

// The capsule body is itself a body model: if it were wrong, every test built on it would lie.
#include "tests/support/capsule_body.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>

namespace booth::tests {
namespace {

TEST(CapsuleBody, RegressesTheAverageSkeletonExactly) {
  const auto body = capsule_body();
  const fit::Points3 vectors = body->bone_vectors(fit::ShapeVector());
  EXPECT_LT((vectors - fit::average_bone_vectors()).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(CapsuleBody, IsItsOwnMirrorImageForEveryShape) {
  const auto body = capsule_body(fit::Sex::women);
  fit::ShapeVector beta = fit::ShapeVector::LinSpaced(kCapsuleShapes, -1, 1.5);
  fit::Vertices v;
  body->shaped(beta, v);
  for (int i = 0; i < body->vertex_count(); ++i) {
    const int m = body->data().mirror_vertex[i];
    EXPECT_EQ(body->data().mirror_vertex[m], i);
    EXPECT_LT((v.col(m) - Eigen::Vector3f(-v(0, i), v(1, i), v(2, i))).norm(), 2e-6f) << "vertex " << i;
  }
}

TEST(CapsuleBody, HasClosedSurfacesThatFaceOutwards) {
  const auto body = capsule_body();
  std::map<std::pair<int, int>, int> edges;
  double volume = 0;
  const auto& d = body->data();
  for (int f = 0; f < d.faces.cols(); ++f) {
    const Eigen::Vector3i t = d.faces.col(f);
    for (int k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
    volume += d.mean.col(t[0]).dot(d.mean.col(t[1]).cross(d.mean.col(t[2]))) / 6;
  }
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1u);
  }
  EXPECT_GT(volume, 0.05);  // m^3; a grown person has 0.06 to 0.1
  EXPECT_LT(volume, 0.11);
}

TEST(CapsuleBody, StandsUprightWithTheLeftHandAtPositiveX) {
  const auto body = capsule_body();
  fit::Vertices v;
  body->posed(fit::ShapeVector(), body->rest_pose(), v);
  EXPECT_NEAR(v.row(1).maxCoeff() - v.row(1).minCoeff(), 1.63, 0.1);
  EXPECT_GT(body->rest_joints(fit::ShapeVector())(0, fit::joint_index("lwrist")), 0.4);
  EXPECT_LT((v - body->data().mean).cwiseAbs().maxCoeff(), 1e-6f);
}

}  // namespace
}  // namespace booth::tests

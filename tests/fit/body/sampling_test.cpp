// The order in which vertices stand for a body is the one that a plain loop over them gives, to the last of equals: every fit depends on it.
#include "fit/body/sampling.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace booth::fit {
namespace {

/// Vertices on a coarse grid, so that many are equally far and some lie on each other.
BodyModel scattered(int count) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> step(-9, 9);
  BodyModelData d;
  d.mean.resize(3, count);
  for (int i = 0; i < count; ++i) d.mean.col(i) = Eigen::Vector3i(step(random), step(random), step(random)).cast<float>() * 0.1f;
  d.directions = Eigen::MatrixXf::Zero(3 * count, 1);
  d.explained = Eigen::VectorXd::Ones(1);
  d.faces = Eigen::Vector3i(0, 1, 2);
  d.skin_bone.setZero(kSkinBones, count);
  d.skin_weight.setZero(kSkinBones, count);
  d.skin_weight.row(0).setOnes();
  d.joint_regressor = Eigen::MatrixXd::Constant(kJoints, count, 1.0 / count);
  d.mirror_vertex = Eigen::VectorXi::LinSpaced(count, 0, count - 1);
  return BodyModel(std::move(d));
}

std::vector<int> plain_loop(const Vertices& v, int count) {
  std::vector<float> distance(static_cast<std::size_t>(v.cols()), std::numeric_limits<float>::max());
  std::vector<int> order;
  Eigen::Index next = 0;
  v.row(1).maxCoeff(&next);
  while (static_cast<int>(order.size()) < count) {
    order.push_back(static_cast<int>(next));
    const Eigen::Vector3f p = v.col(next);
    float farthest = -1;
    for (Eigen::Index i = 0; i < v.cols(); ++i) {
      float& d = distance[static_cast<std::size_t>(i)];
      const Eigen::Vector3f to = v.col(i) - p;
      d = std::min(d, to.x() * to.x() + (to.y() * to.y() + to.z() * to.z()));  // not squaredNorm(): its order of summing is the machine's, and there are ties
      if (d > farthest) farthest = d, next = i;
    }
  }
  return order;
}

TEST(SpreadVertices, IsTheOrderOfAPlainLoop) {
  const BodyModel model = scattered(1003);
  const auto all = spread_vertices(model, 5000);
  ASSERT_EQ(all.size(), 1003u) << "more than there are";
  EXPECT_EQ(all, plain_loop(model.data().mean, 1003));
}

TEST(SpreadVertices, AnyLeadingPartIsTheShorterOrder) {
  const BodyModel model = scattered(501);
  const auto all = spread_vertices(model, 501);
  for (const int n : {0, 1, 2, 77, 500}) EXPECT_EQ(spread_vertices(model, n), std::vector<int>(all.begin(), all.begin() + n)) << n;
}

}  // namespace
}  // namespace booth::fit

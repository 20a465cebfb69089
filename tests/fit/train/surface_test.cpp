// Remeshing of half a sphere: its mirror image closes it, and every vertex remains a convex combination of the original ones.
#include "fit/train/surface.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace booth::fit::train {
namespace {

struct Half {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<int, 3>> faces;
  std::vector<char> midline;
};

/// The half x >= 0 of a sphere of radius 1 as a grid over two angles; the rim lies in x = 0.
Half half_sphere(int rings, int sides) {
  Half h;
  h.points.emplace_back(1, 0, 0);
  h.midline.push_back(0);
  for (int r = 1; r <= rings; ++r)
    for (int s = 0; s < sides; ++s) {
      const double polar = 1.5707963267948966 * r / rings, turn = 6.283185307179586 * s / sides;
      h.points.emplace_back(r == rings ? 0 : std::cos(polar), std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn));
      h.midline.push_back(r == rings);
    }
  const auto at = [&](int r, int s) { return r == 0 ? 0 : 1 + (r - 1) * sides + (s % sides); };
  for (int s = 0; s < sides; ++s) {
    h.faces.push_back({0, at(1, s), at(1, s + 1)});
    for (int r = 1; r < rings; ++r) {
      h.faces.push_back({at(r, s), at(r + 1, s), at(r + 1, s + 1)});
      h.faces.push_back({at(r, s), at(r + 1, s + 1), at(r, s + 1)});
    }
  }
  return h;
}

/// Edges of the half by use; a disc has some used once, none more than twice.
void expect_disc(const Surface& s) {
  std::map<std::pair<int, int>, int> uses;
  std::map<int, int> vertices;
  const auto faces = s.faces();
  for (const auto& f : faces)
    for (int i = 0; i < 3; ++i) {
      ++uses[std::minmax(f[static_cast<std::size_t>(i)], f[static_cast<std::size_t>((i + 1) % 3)])];
      ++vertices[f[static_cast<std::size_t>(i)]];
    }
  for (const auto& [edge, n] : uses) {
    EXPECT_LE(n, 2);
    const bool rim = s.midline(edge.first) && s.midline(edge.second);
    EXPECT_EQ(n == 1, rim) << "an edge between two rim vertices must be of the rim, and only those";
  }
  EXPECT_EQ(static_cast<int>(vertices.size()) - static_cast<int>(uses.size()) + static_cast<int>(faces.size()), 1);
}

TEST(Surface, RemeshedHalfStaysADiscWithEvenEdges) {
  const Half h = half_sphere(24, 60);
  Surface s(h.points, h.faces, h.midline);
  constexpr double kTarget = 0.2;
  s.remesh(kTarget, 6);
  expect_disc(s);
  double shortest = 1e9, longest = 0, sum = 0;
  int count = 0;
  for (const auto& f : s.faces())
    for (int i = 0; i < 3; ++i) {
      const double length = (s.position(f[static_cast<std::size_t>(i)]) - s.position(f[static_cast<std::size_t>((i + 1) % 3)])).norm();
      shortest = std::min(shortest, length);
      longest = std::max(longest, length);
      sum += length;
      ++count;
    }
  EXPECT_NEAR(sum / count, kTarget, 0.15 * kTarget);
  EXPECT_GT(shortest, 0.3 * kTarget);
  EXPECT_LT(longest, 1.8 * kTarget);
}

TEST(Surface, RowsAreConvexCombinationsThatGiveThePositions) {
  const Half h = half_sphere(10, 24);
  Surface s(h.points, h.faces, h.midline);
  s.remesh(0.08, 4);  // finer than the input: splits
  for (int v = 0; v < s.vertex_count(); ++v) {
    if (!s.alive(v)) continue;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    float weight = 0;
    for (const auto& [i, w] : s.row(v)) {
      EXPECT_GT(w, 0);
      weight += w;
      sum += w * h.points[static_cast<std::size_t>(i)];
    }
    EXPECT_NEAR(weight, 1, 1e-5);
    EXPECT_LT((sum - s.position(v)).norm(), 1e-5);
    if (s.midline(v)) {
      EXPECT_NEAR(s.position(v).x(), 0, 1e-12);
    }
  }
}

TEST(Surface, RemovedVerticesAreGoneAndTheSurfaceIsStillADisc) {
  const Half h = half_sphere(12, 30);
  Surface s(h.points, h.faces, h.midline);
  std::vector<char> marked(h.points.size(), 0);
  for (std::size_t v = 0; v < h.points.size(); ++v) marked[v] = h.points[v].x() > 0.8;
  s.remove_vertices(marked);
  for (std::size_t v = 0; v < marked.size(); ++v) {
    if (marked[v]) {
      EXPECT_FALSE(s.alive(static_cast<int>(v))) << v;
    }
  }
  expect_disc(s);
}

}  // namespace
}  // namespace booth::fit::train

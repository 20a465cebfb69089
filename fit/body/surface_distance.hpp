// How far a point is from a triangle mesh: what error figures are made of.
#pragma once

#include <vector>

#include "fit/body/body_model.hpp"
#include "fit/cloud/point_grid.hpp"

namespace booth::fit {

/// Distances to a mesh of fixed topology whose vertices move. Off the hot path; set() allocates only on growth. distance() is thread-safe.
class SurfaceDistance {
 public:
  /// Throws std::invalid_argument when a face names a vertex that does not exist.
  SurfaceDistance(const Faces& faces, int vertex_count);

  /// The surface to measure against.
  void set(const Vertices& vertices);

  /// Distance (m) to the nearest point of the triangles around the vertices nearest to p. Exact where the mesh is evenly spaced.
  float distance(const Eigen::Vector3f& p) const;

 private:
  const Faces faces_;
  std::vector<int> first_face_, face_of_vertex_;  ///< compressed rows: faces around each vertex
  Vertices vertices_;
  std::vector<float> x_, y_, z_;
  PointGrid grid_;
};

/// Distance from p to the triangle (a, b, c).
float triangle_distance(const Eigen::Vector3f& p, const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c);

}  // namespace booth::fit

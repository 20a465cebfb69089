// How far a point is from a triangle mesh: what error figures are made of.
#pragma once

#include <vector>

#include "fit/body/body_model.hpp"
#include "fit/cloud/point_grid.hpp"

namespace booth::fit {

/// The point of a mesh that is nearest to another point.
struct SurfaceFoot {
  int face = -1;                                      ///< none: nothing in reach
  Eigen::Vector3f weights = Eigen::Vector3f::Zero();  ///< barycentric, of the face's three vertices
  float distance = 0;                                 ///< m
};

/// Distances to a mesh of fixed topology whose vertices move. Off the hot path; set() allocates only on growth. distance() is thread-safe.
class SurfaceDistance {
 public:
  /// Throws std::invalid_argument when a face names a vertex that does not exist.
  SurfaceDistance(const Faces& faces, int vertex_count);

  /// The surface to measure against.
  void set(const Vertices& vertices);

  /// Distance (m) to the nearest point of the triangles around the vertices nearest to p. Exact where the mesh is evenly spaced.
  float distance(const Eigen::Vector3f& p) const;

  /// The same with vertex normals, for closest(). `normals`: unit, as many as vertices.
  void set(const Vertices& vertices, const Vertices& normals);
  /// The nearest point of the triangles around the vertex that is nearest to p, nearer than `reach` (m), and whose normal makes an angle with `normal` whose
  /// cosine is above min_cosine (zero normal: any vertex). After set() with normals.
  SurfaceFoot closest(const Eigen::Vector3f& p, float reach, const Eigen::Vector3f& normal, float min_cosine) const;

  std::size_t memory_bytes() const;

 private:
  void set(const Vertices& vertices, const Vertices* normals);
  const Faces faces_;
  std::vector<int> first_face_, face_of_vertex_;  ///< compressed rows: faces around each vertex and around its neighbours
  Vertices vertices_;
  std::vector<float> x_, y_, z_, nx_, ny_, nz_;
  PointGrid grid_;
};

/// The point of the triangle (a, b, c) nearest to p, by its barycentric weights (face is not set).
SurfaceFoot closest_on_triangle(const Eigen::Vector3f& p, const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c);
/// Distance from p to the triangle (a, b, c).
float triangle_distance(const Eigen::Vector3f& p, const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c);

}  // namespace booth::fit

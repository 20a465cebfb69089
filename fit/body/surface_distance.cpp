// Nearest vertex first, then the triangles around it and around its neighbours.
#include "fit/body/surface_distance.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <stdexcept>

namespace booth::fit {

float triangle_distance(const Eigen::Vector3f& p, const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
  const Eigen::Vector3f ab = b - a, ac = c - a, ap = p - a;
  const Eigen::Vector3f n = ab.cross(ac);
  const float area2 = n.squaredNorm();
  if (area2 > 1e-20f) {
    // Barycentric coordinates of the projection; inside: the distance to the plane.
    const float v = ap.cross(ac).dot(n) / area2, w = ab.cross(ap).dot(n) / area2;
    if (v >= 0 && w >= 0 && v + w <= 1) return std::abs(ap.dot(n)) / std::sqrt(area2);
  }
  const auto edge = [&](const Eigen::Vector3f& s, const Eigen::Vector3f& e) {
    const Eigen::Vector3f d = e - s;
    const float t = std::clamp((p - s).dot(d) / std::max(d.squaredNorm(), 1e-20f), 0.0f, 1.0f);
    return (p - s - t * d).norm();
  };
  return std::min({edge(a, b), edge(b, c), edge(c, a)});
}

SurfaceDistance::SurfaceDistance(const Faces& faces, int vertex_count) : faces_(faces), grid_(vertex_count) {
  if (faces.cols() == 0 || faces.minCoeff() < 0 || faces.maxCoeff() >= vertex_count)
    throw std::invalid_argument("surface: a face names a vertex that does not exist");
  first_face_.assign(static_cast<std::size_t>(vertex_count) + 1, 0);
  for (const int v : faces_.reshaped()) ++first_face_[static_cast<std::size_t>(v) + 1];
  for (std::size_t v = 1; v < first_face_.size(); ++v) first_face_[v] += first_face_[v - 1];
  face_of_vertex_.resize(static_cast<std::size_t>(faces_.size()));
  std::vector<int> next(first_face_.begin(), first_face_.end() - 1);
  for (int f = 0; f < faces_.cols(); ++f)
    for (int i = 0; i < 3; ++i) face_of_vertex_[static_cast<std::size_t>(next[static_cast<std::size_t>(faces_(i, f))]++)] = f;
}

void SurfaceDistance::set(const Vertices& vertices) {
  vertices_ = vertices;
  const auto n = static_cast<std::size_t>(vertices.cols());
  x_.resize(n), y_.resize(n), z_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto v = vertices.col(static_cast<Eigen::Index>(i));
    x_[i] = v.x(), y_[i] = v.y(), z_[i] = v.z();
  }
  grid_.rebuild(x_.data(), y_.data(), z_.data(), static_cast<int>(n));
}

float SurfaceDistance::distance(const Eigen::Vector3f& p) const {
  int nearest = grid_.nearest(p, 0.10f);
  if (nearest < 0) nearest = grid_.nearest(p, std::numeric_limits<float>::max());
  float best = (vertices_.col(nearest) - p).norm();
  const auto around = [&](int v, auto&& visit) {
    for (int i = first_face_[static_cast<std::size_t>(v)]; i < first_face_[static_cast<std::size_t>(v) + 1]; ++i)
      visit(face_of_vertex_[static_cast<std::size_t>(i)]);
  };
  around(nearest, [&](int f) {
    for (int i = 0; i < 3; ++i)
      around(faces_(i, f), [&](int g) {
        best = std::min(best, triangle_distance(p, vertices_.col(faces_(0, g)), vertices_.col(faces_(1, g)), vertices_.col(faces_(2, g))));
      });
  });
  return best;
}

}  // namespace booth::fit

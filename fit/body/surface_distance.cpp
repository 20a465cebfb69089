// Nearest vertex first, then the triangles around it and around its neighbours.
#include "fit/body/surface_distance.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <limits>
#include <stdexcept>

namespace booth::fit {

SurfaceFoot closest_on_triangle(const Eigen::Vector3f& p, const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
  const Eigen::Vector3f ab = b - a, ac = c - a, ap = p - a;
  const Eigen::Vector3f n = ab.cross(ac);
  const float area2 = n.squaredNorm();
  SurfaceFoot best;
  if (area2 > 1e-20f) {
    // Barycentric coordinates of the projection; inside: the distance to the plane.
    const float v = ap.cross(ac).dot(n) / area2, w = ab.cross(ap).dot(n) / area2;
    if (v >= 0 && w >= 0 && v + w <= 1) {
      best.weights = {1 - v - w, v, w};
      best.distance = std::abs(ap.dot(n)) / std::sqrt(area2);
      return best;
    }
  }
  best.distance = std::numeric_limits<float>::max();
  const std::array<const Eigen::Vector3f*, 3> corner{&a, &b, &c};
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3f &s = *corner[static_cast<std::size_t>(i)], &e = *corner[static_cast<std::size_t>((i + 1) % 3)];
    const Eigen::Vector3f d = e - s;
    const float t = std::clamp((p - s).dot(d) / std::max(d.squaredNorm(), 1e-20f), 0.0f, 1.0f);
    const float distance = (p - s - t * d).norm();
    if (distance >= best.distance) continue;
    best.distance = distance;
    best.weights.setZero();
    best.weights[i] = 1 - t, best.weights[(i + 1) % 3] = t;
  }
  return best;
}

float triangle_distance(const Eigen::Vector3f& p, const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
  return closest_on_triangle(p, a, b, c).distance;
}

SurfaceDistance::SurfaceDistance(const Faces& faces, int vertex_count) : faces_(faces), grid_(vertex_count) {
  if (faces.cols() == 0 || faces.minCoeff() < 0 || faces.maxCoeff() >= vertex_count)
    throw std::invalid_argument("surface: a face names a vertex that does not exist");
  std::vector<std::vector<int>> own(static_cast<std::size_t>(vertex_count));
  for (int f = 0; f < faces_.cols(); ++f)
    for (int i = 0; i < 3; ++i) own[static_cast<std::size_t>(faces_(i, f))].push_back(f);
  first_face_.push_back(0);
  std::vector<int> ring;
  for (const auto& faces_here : own) {
    ring.clear();
    for (const int f : faces_here)
      for (int i = 0; i < 3; ++i)
        ring.insert(ring.end(), own[static_cast<std::size_t>(faces_(i, f))].begin(), own[static_cast<std::size_t>(faces_(i, f))].end());
    std::sort(ring.begin(), ring.end());
    face_of_vertex_.insert(face_of_vertex_.end(), ring.begin(), std::unique(ring.begin(), ring.end()));
    first_face_.push_back(static_cast<int>(face_of_vertex_.size()));
  }
}

std::size_t SurfaceDistance::memory_bytes() const {
  return sizeof(*this) + static_cast<std::size_t>(faces_.size()) * sizeof(int) + (first_face_.capacity() + face_of_vertex_.capacity()) * sizeof(int) +
         (static_cast<std::size_t>(vertices_.size()) + 3 * (x_.capacity() + nx_.capacity())) * sizeof(float) + grid_.memory_bytes();
}

void SurfaceDistance::set(const Vertices& vertices) { set(vertices, nullptr); }

void SurfaceDistance::set(const Vertices& vertices, const Vertices& normals) { set(vertices, &normals); }

void SurfaceDistance::set(const Vertices& vertices, const Vertices* normals) {
  vertices_ = vertices;
  const auto n = static_cast<std::size_t>(vertices.cols());
  const auto split = [n](const Vertices& from, std::vector<float>& x, std::vector<float>& y, std::vector<float>& z) {
    x.resize(n), y.resize(n), z.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      const auto v = from.col(static_cast<Eigen::Index>(i));
      x[i] = v.x(), y[i] = v.y(), z[i] = v.z();
    }
  };
  split(vertices, x_, y_, z_);
  if (normals == nullptr) {
    grid_.rebuild(x_.data(), y_.data(), z_.data(), static_cast<int>(n));
    return;
  }
  split(*normals, nx_, ny_, nz_);
  grid_.rebuild(x_.data(), y_.data(), z_.data(), nx_.data(), ny_.data(), nz_.data(), static_cast<int>(n));
}

float SurfaceDistance::distance(const Eigen::Vector3f& p) const {
  int nearest = grid_.nearest(p, 0.10f);
  if (nearest < 0) nearest = grid_.nearest(p, std::numeric_limits<float>::max());
  float best = (vertices_.col(nearest) - p).norm();
  for (int i = first_face_[static_cast<std::size_t>(nearest)]; i < first_face_[static_cast<std::size_t>(nearest) + 1]; ++i) {
    const auto t = faces_.col(face_of_vertex_[static_cast<std::size_t>(i)]);
    best = std::min(best, triangle_distance(p, vertices_.col(t[0]), vertices_.col(t[1]), vertices_.col(t[2])));
  }
  return best;
}

SurfaceFoot SurfaceDistance::closest(const Eigen::Vector3f& p, float reach, const Eigen::Vector3f& normal, float min_cosine) const {
  SurfaceFoot best;
  const int nearest = normal.isZero() ? grid_.nearest(p, reach) : grid_.nearest(p, reach, normal, min_cosine);
  if (nearest < 0) return best;
  best.distance = std::numeric_limits<float>::max();
  for (int i = first_face_[static_cast<std::size_t>(nearest)]; i < first_face_[static_cast<std::size_t>(nearest) + 1]; ++i) {
    const int f = face_of_vertex_[static_cast<std::size_t>(i)];
    const auto t = faces_.col(f);
    SurfaceFoot foot = closest_on_triangle(p, vertices_.col(t[0]), vertices_.col(t[1]), vertices_.col(t[2]));
    if (foot.distance < best.distance) best = foot, best.face = f;
  }
  return best;
}

}  // namespace booth::fit

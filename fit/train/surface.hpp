// A triangle surface that can be remeshed while every vertex stays a fixed convex combination of the vertices of a base mesh.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "fit/train/base_body.hpp"

namespace booth::fit::train {

/// One half (x >= 0) of a symmetric surface, open along the mirror plane. Vertices on the plane are "midline" and stay on it, and
/// no edge but those of the rim joins two of them, so that the half and its mirror image make a closed manifold.
class Surface {
 public:
  /// `faces` index `positions`; vertices with midline[i] lie on the rim. Rows start as the identity.
  Surface(std::vector<Eigen::Vector3d> positions, std::vector<std::array<int, 3>> faces, std::vector<char> midline);

  /// Takes marked vertices away by collapsing their edges onto neighbours, whatever becomes of the shape; bags shrink to their openings.
  void remove_vertices(const std::vector<char>& marked);
  /// Splits, collapses and flips edges until they are about `target` metres long.
  void remesh(double target, int rounds);

  int vertex_count() const { return static_cast<int>(position_.size()); }
  bool alive(int v) const { return !vertex_faces_[static_cast<std::size_t>(v)].empty(); }
  bool midline(int v) const { return midline_[static_cast<std::size_t>(v)] != 0; }
  const Eigen::Vector3d& position(int v) const { return position_[static_cast<std::size_t>(v)]; }
  const SparseRow& row(int v) const { return row_[static_cast<std::size_t>(v)]; }
  /// Faces that still exist.
  std::vector<std::array<int, 3>> faces() const;

 private:
  struct Edge {
    int a, b;
    double length;
  };
  std::vector<Edge> edges() const;
  std::vector<int> neighbours(int v) const;
  std::vector<int> shared_faces(int a, int b) const;
  int opposite(int face, int a, int b) const;
  double length(int a, int b) const { return (position(a) - position(b)).norm(); }
  bool may_collapse(int from, int onto) const;
  bool keeps_shape(int from, int onto, double longest) const;
  void collapse(int from, int onto);
  void split(int a, int b);
  bool flip_if_better(int a, int b);
  void remove_face(int face);
  void add_face(std::array<int, 3> corners);
  Eigen::Vector3d normal(int a, int b, int c) const;

  std::vector<Eigen::Vector3d> position_;
  std::vector<SparseRow> row_;
  std::vector<char> midline_;
  std::vector<std::array<int, 3>> face_;  // first corner -1: removed
  std::vector<std::vector<int>> vertex_faces_;
};

}  // namespace booth::fit::train

// The one topology that all bodies share: made once from the base mesh, and a fixed linear map from it.
#pragma once

#include "fit/body/body_model.hpp"
#include "fit/train/base_body.hpp"

namespace booth::fit::train {

struct TemplateMesh {
  std::vector<SparseRow> rows;    ///< template vertex -> convex combination of base vertices
  Faces faces;                    ///< closed, genus 0
  Eigen::VectorXi mirror_vertex;  ///< exact left/right counterpart
  Vertices average;               ///< on the body that `positions` described, metres

  int vertex_count() const { return static_cast<int>(rows.size()); }
  /// The template on a morphed base mesh.
  Vertices apply(const Eigen::Matrix3Xd& base_vertices) const;
};

/// `positions`: the base mesh morphed to an average person (symmetric), in which edge lengths are judged.
/// Throws std::invalid_argument when the base mesh is not symmetric or closed.
TemplateMesh make_template(const BaseBody& base, const Eigen::Matrix3Xd& positions, double edge_length);

/// For each quad of the skin: from how many of `directions` evenly spread directions at least one pixel of it is seen. Eyeballs occlude.
std::vector<int> count_views(const BaseBody& base, const Eigen::Matrix3Xd& positions, int directions, double pixel);

/// What a mesh check finds.
struct MeshReport {
  int vertices = 0, edges = 0, faces = 0;
  int open_edges = 0, overused_edges = 0;  ///< edges with one face, or with more than two
  int components = 0;
  int euler() const { return vertices - edges + faces; }
  double edge_mean = 0, edge_p05 = 0, edge_p95 = 0;  ///< metres
};
MeshReport inspect(const Vertices& vertices, const Faces& faces);

}  // namespace booth::fit::train

// What no shape space holds: folds, hair, clothes and shoes as an offset of each vertex along its normal, averaged over all moments that saw it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "fit/body/body_model.hpp"
#include "fit/body/surface_distance.hpp"
#include "fit/cloud/observation.hpp"
#include "fit/detail/surface_system.hpp"

namespace booth::fit {

struct DistanceStatistics;

/// Lengths in metres. Why these values: docs/design/detail.md.
struct DetailSettings {
  double sigma = 0.004;       ///< standard deviation of a point's distance from the surface that it was measured on
  double step = 0.004;        ///< expected difference of the offsets of neighbouring vertices, about 1.9 cm apart
  double size = 0.03;         ///< expected offset where nothing was seen: it fades to zero
  float reach = 0.08f;        ///< points further from the surface are no detail of it
  float robust = 0.02f;       ///< Geman-McClure scale of a point's distance
  float most = 0.12f;         ///< no offset is larger
  int points = 40000;         ///< of a moment's cloud, evenly picked, that are looked at
  int solver_steps = 200;     ///< of conjugate gradients at most
  double frames = 60;         ///< add() never lets the past weigh more than so many moments
  double frame_trust = 0.25;  ///< moments 1/30 s apart share the errors of the body's pose, so each counts for less than one
};

/// Offsets in the resting pose: v'_rest = v_rest + d n_rest, posed by the model's own skinning, so that they follow the body into every pose. Per vertex a
/// robust least-squares mean of the points' distances, tied to its neighbours by a graph Laplacian; vertices that nothing was seen of continue their
/// neighbours and fade to zero. Allocates in the constructor only. One thread at a time; the same input gives the same bits.
class DetailLayer {
 public:
  /// The model must outlive the layer.
  explicit DetailLayer(const BodyModel& model, DetailSettings settings = {});

  /// Forgets everything: all offsets are zero.
  void reset();
  /// One moment by itself: what was known is forgotten, and correspondences and offsets are found in turn, `rounds` times.
  void fit(const Observation& observation, const ShapeVector& beta, const PoseVector& q, int rounds = 6);
  /// One more moment of the same person, followed from frame to frame: joins what is known.
  void add(const Observation& observation, const ShapeVector& beta, const PoseVector& q);

  /// Metres along the resting normal, outwards positive; one per vertex of the model.
  const Eigen::VectorXd& offsets() const { return offsets_; }
  /// True where points have said more of the vertex than its neighbours and the fading do.
  bool seen(int vertex) const;
  /// Moments that the offsets rest on.
  int moments() const { return moments_; }

  /// Adds the offsets to a resting body of this model.
  void apply(const Vertices& rest, Vertices& out) const;
  /// Distances of at most 20,000 evenly picked points to the posed surface with its offsets. Allocates.
  DistanceStatistics distances(const Cloud& cloud, const ShapeVector& beta, const PoseVector& q);
  std::size_t memory_bytes() const;

 private:
  void place(const ShapeVector& beta, const PoseVector& q);
  void stand();
  void collect(const Observation& observation, int points, float robust, float reach, double trust);
  void solve();

  const BodyModel& model_;
  DetailSettings settings_;
  SurfaceSystem system_;
  SurfaceDistance surface_;
  Eigen::VectorXd offsets_;
  Vertices rest_, rest_normals_;  ///< of the body without detail
  Vertices base_, way_;           ///< posed without detail; where one metre of offset moves a vertex
  Vertices posed_, normals_;      ///< with detail
  Vertices before_, velocity_;    ///< base_ of the moment before, m/s
  double time_ = 0;
  int moments_ = 0;
  bool moving_ = false;
};

/// rest + offset * normal of `rest`, per vertex; `out` is resized on first use only.
void displace(const Vertices& rest, const Faces& faces, const Eigen::VectorXd& offsets, Vertices& out);

}  // namespace booth::fit

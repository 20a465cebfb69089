// What a solution is worth: distances, coverage, which joints were seen and how well each is known.
#pragma once

#include <vector>

#include "fit/body/surface_distance.hpp"
#include "fit/estimator.hpp"
#include "fit/refine/refiner.hpp"

namespace booth::fit {

/// Fixed buffers for the figures of one body model. One thread calls at a time.
class Diagnostics {
 public:
  explicit Diagnostics(const BodyModel& model);

  /// Fills joints, rotations, visibility, distances and coverage of `result` for its q and beta. `exact`: distances to triangles of the whole
  /// surface instead of to tangent planes; slower.
  void describe(const Observation& observation, bool exact, FitResult& result);

  /// Covariances of the joints and of the shape from the information matrix of a refinement whose unknowns are q and perhaps the shape; where the shape
  /// was held, `shape_information` is what is known of it. After describe(), which says which joints were seen.
  void covariance(const UnknownMatrix& information, const UnknownMatrix& shape_information, FitResult& result) const;

  const Vertices& vertices() const { return vertices_; }
  /// Taken in the constructor.
  std::size_t memory_bytes() const;

 private:
  static constexpr int kSamples = 2000;
  Poser poser_;
  PointGrid body_, cloud_;
  Vertices vertices_;
  SurfaceDistance surface_;
  std::vector<float> distance_, x_, y_, z_, nx_, ny_, nz_;
};

}  // namespace booth::fit

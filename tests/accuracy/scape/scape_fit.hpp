// Fits SCAPE to a cloud by closest points: correspondences, vertices, rotations and shape in turns.
#pragma once

#include "fit/cloud/observation.hpp"
#include "tests/accuracy/scape/scape_model.hpp"

namespace booth::accuracy {

struct ScapeFit {
  fit::Vertices vertices;
  Eigen::VectorXf beta;
  int iterations = 0;
};

/// From the template in pose `start`. The unknowns are the vertices (a sparse least-squares problem over the triangles' edges), one rotation for each part and
/// the shape coefficients; as published nothing holds the pose but the cloud.
ScapeFit fit_scape(const ScapeModel& scape, const fit::Cloud& cloud, const fit::PoseVector& start);

}  // namespace booth::accuracy

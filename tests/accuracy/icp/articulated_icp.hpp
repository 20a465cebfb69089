// A baseline: iterated closest points on the skeleton of the mean body, with no prior and no shape.
#pragma once

#include "fit/body/body_model.hpp"
#include "fit/cloud/observation.hpp"

namespace booth::accuracy {

/// The pose of the mean body whose surface lies closest to the cloud's points, by point-to-point Gauss-Newton steps from `start`.
fit::PoseVector fit_articulated_icp(const fit::BodyModel& model, const fit::Cloud& cloud, const fit::PoseVector& start);

}  // namespace booth::accuracy

// A cloud that is a posed body's own surface, for tests of the fit that need no camera.
#pragma once

#include "fit/body/poser.hpp"
#include "fit/cloud/observation.hpp"

namespace booth::tests {

/// Every vertex of the posed body with its normal; no views. `noise` (m): normal deviation of each point along its normal, keyed by `seed`.
fit::Observation posed_cloud(const fit::BodyModel& model, const fit::ShapeVector& beta, const fit::PoseVector& q, float noise = 0, std::uint64_t seed = 1);

/// The first of the plain prior's standing poses with some angles (degrees) changed.
fit::PoseVector pose_with(std::initializer_list<std::pair<std::string_view, double>> degrees);

}  // namespace booth::tests

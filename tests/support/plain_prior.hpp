// A pose prior written by hand, so that tests of the fit need no trained one.
#pragma once

#include <memory>

#include "fit/prior/pose_prior.hpp"

namespace booth::tests {

/// Standing mean, all directions equally likely within human limits, and a dozen exemplar poses (A, T, standing, arms raised, walking, squatting).
std::shared_ptr<const fit::PosePrior> plain_prior();

}  // namespace booth::tests

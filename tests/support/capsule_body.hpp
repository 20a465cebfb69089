// A small body made of tubes around the CMU bones, so that tests have a valid model without a trained one.
#pragma once

#include <memory>

#include "fit/body/body_model.hpp"

namespace booth::tests {

inline constexpr int kCapsuleShapes = 10;

/// About 700 vertices in the A-pose, left/right symmetric, CMU frame, metres, root joint at the origin. The joint regressor is exact:
/// a joint is the mean of the ring around it, or the tip of its tube. At beta = 0 the men's bones have the lengths of the CMU average skeleton.
/// Coefficients: stature, girth, leg, arm and torso length, shoulder and hip width, belly, thickness of the limbs, size of head and feet.
fit::BodyModelData capsule_body_data(fit::Sex sex = fit::Sex::men);

std::shared_ptr<const fit::BodyModel> capsule_body(fit::Sex sex = fit::Sex::men);

}  // namespace booth::tests

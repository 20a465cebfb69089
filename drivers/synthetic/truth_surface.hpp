// Between the simulated person and the plain truth body that a recording stores.
#pragma once

#include "drivers/synthetic/scene.hpp"
#include "drivers/truth_body.hpp"

namespace booth::drivers {

TruthBody truth_body(const Person& person);

/// A drivers::TruthSurface: smooth skinning as in MATH.md 2. Empty when the body has no vertices.
std::vector<std::array<float, 3>> truth_surface(const TruthBody& body, const std::array<double, 36>& q);

}  // namespace booth::drivers

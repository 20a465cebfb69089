// Which of a body's vertices stand for all of it: a nested, evenly spread order.
#pragma once

#include <vector>

#include "fit/body/body_model.hpp"

namespace booth::fit {

/// Farthest-point order of the mean body's vertices: the first n are evenly spread for any n. Deterministic; O(V * count), at construction only.
std::vector<int> spread_vertices(const BodyModel& model, int count);

/// Area of the mean body (m^2) that each of the given vertices stands for: every vertex's area goes to the nearest of them. Sums to the body's area.
std::vector<float> represented_area(const BodyModel& model, const std::vector<int>& vertices);

}  // namespace booth::fit

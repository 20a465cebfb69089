// How a mesh of flat facets lies below its vertices' tangent planes: without it, distances to those planes make every fitted body too thin.
#pragma once

#include <vector>

#include "fit/body/body_model.hpp"

namespace booth::fit {

/// For each vertex the mean slope at which its edges fall below its tangent plane (negative in a hollow); no unit. A point of the surface that lies `across`
/// metres from the vertex, along the tangent plane, is about slope * across below it where the skin is flat between vertices, and less than half of
/// that in the mean where it is smooth. The slope is that of the mean body: it does not change with size.
std::vector<float> facet_fall(const BodyModelData& data);

}  // namespace booth::fit

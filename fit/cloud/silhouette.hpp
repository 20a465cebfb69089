// For every place in an image, the way to the person's outline: what a model vertex that projects beside the person is told.
#pragma once

#include "fit/cloud/observation.hpp"

namespace booth::fit {

/// Fills view.nearest_dx and nearest_dy from view.label. The way is exact at pixels of the person's blocks and within a pixel or two elsewhere.
/// Allocates nothing.
void map_silhouette(View& view);

}  // namespace booth::fit

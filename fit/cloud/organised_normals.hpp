// Surface normals from a depth image's own neighbourhoods.
#pragma once

#include <cstddef>

namespace booth::fit {

inline constexpr int kNormalRadius = 2;  ///< the window is 5 x 5
inline constexpr int kNormalLanes = 16;  ///< pixels of a row handled at once

/// An affine fit w = w0 + a du + b dv of the inverse depth (1/m) around a pixel. On a plane the inverse depth is affine in the image, whatever the
/// slant, so the fit has no bias on flat skin.
struct InverseDepthFit {
  float w0[kNormalLanes], a[kNormalLanes], b[kNormalLanes];
  float support[kNormalLanes];  ///< neighbours used, the pixel included; 0: too few, or all on a line
};

/// Fits kNormalLanes pixels from `row`, which points into an inverse-depth image of `stride` floats a row, 0 = nothing there, with at least
/// kNormalRadius rows and columns readable on every side. A neighbour counts when its inverse depth differs by less than gate_a w^2 + gate_b w.
/// The same bits on every machine.
void fit_inverse_depth(const float* row, std::ptrdiff_t stride, float gate_a, float gate_b, InverseDepthFit& out);

}  // namespace booth::fit

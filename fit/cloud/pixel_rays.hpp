// Per-pixel tables of a depth camera: where each pixel looks, and between which depths it sees the stage.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fit/cloud/cloud_builder.hpp"

namespace booth::fit {

/// Larger images are refused: no depth camera has them, and a row of flags must fit the stack.
inline constexpr int kMaxImageWidth = 4096;

/// Made once for each camera; const afterwards.
struct PixelRays {
  /// Throws std::invalid_argument that says what is wrong with the camera.
  PixelRays(const Camera& camera, const CloudSettings& settings);

  /// Narrows the gate to what stands before the background; an empty span widens it again. `depth` as in DepthInput.
  void set_background(std::span<const std::uint16_t> depth);

  /// The point (CMU frame) that pixel i sees at `depth` metres along the optical axis.
  Eigen::Vector3f point(std::size_t i, float depth) const { return centre + depth * (to_world * Eigen::Vector3f(x[i], y[i], 1)); }

  int width, height;
  float scale, offset;                 ///< a count c lies c * scale + offset metres away
  std::uint16_t min_count, max_count;  ///< a measurement lies between these, ends included
  Eigen::Matrix3f to_world;
  Eigen::Vector3f centre;
  std::vector<float> x, y;               ///< undistorted ray (x, y, 1) of each pixel
  std::vector<std::uint16_t> near, far;  ///< the stage begins and ends at these counts (included); near > far: the pixel never sees it
  std::vector<std::uint16_t> stage_far;  ///< `far` without a background

 private:
  float background_margin_, background_relative_;
};

}  // namespace booth::fit

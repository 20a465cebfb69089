// Pictures of a fit, to be looked at: over the depth image that it explains, or the body by itself from any side.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "daemon/io/picture.hpp"
#include "fit/body/body_model.hpp"
#include "fit/cloud/observation.hpp"

namespace booth::daemon {

/// Depth (counts, row-major width * height; 0 = none drawn dark blue) as grey, near bright, between the 2nd and 98th percentile of what is there.
Picture draw_depth(std::span<const std::uint16_t> depth, int width, int height);

struct OverlayStyle {
  int rotation = 0;            ///< 0, 90, 180, 270: clockwise, for a camera that lies on its side
  int scale = 2;               ///< pixels of the picture per pixel of the image
  float mesh_opacity = 0.45f;  ///< 0: no mesh
  bool skeleton = true;        ///< left limbs cyan, right limbs orange, trunk yellow
};

/// The depth image with the fitted mesh (shaded, its own hidden parts removed) and the skeleton projected into it, distortion included.
/// `vertices` and `joints` in the CMU frame; either may be empty (nullptr joints). Throws std::invalid_argument when the depth is not camera.width * height.
Picture draw_overlay(std::span<const std::uint16_t> depth, const fit::Camera& camera, const fit::Vertices& vertices, const fit::Faces& faces,
                     const fit::Points3* joints, std::string_view caption, const OverlayStyle& style = {});

/// One thing in a scene: a mesh (faces given) or a cloud of dots.
struct SceneItem {
  const Eigen::Matrix3Xf& points;  ///< CMU frame, metres
  const fit::Faces* faces = nullptr;
  const std::vector<Colour>* colours = nullptr;  ///< one per point, or none: `colour` for all
  Colour colour{200, 195, 190};
};

struct SceneStyle {
  int width = 480, height = 640;
  Eigen::Vector3f from{0, 0.15f, 1};  ///< direction from the scene towards the eye, CMU frame; z = in front of the person
  float metres_high = 0;              ///< what the picture's height shows; 0: everything fits
  Colour background{250, 250, 250};
};

/// Parallel projection, shaded, depth-tested, smooth edges.
Picture draw_scene(std::span<const SceneItem> items, std::string_view caption, const SceneStyle& style = {});

/// From blue (0) over green and yellow to red (>= most): for distances on a surface.
Colour heat(float value, float most);

}  // namespace booth::daemon

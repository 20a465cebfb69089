// Finds the camera that was moved while boards were being shown: the one whose pictures fit when it may stand in two places.
#pragma once

#include <optional>
#include <span>

#include "fit/calibrate/bundle.hpp"

namespace booth::fit::calibrate {

struct MovedCamera {
  int camera = 0;
  int view = 0;  ///< the first view from its new place
  double metres = 0, radians = 0;
};

/// Tries each camera and each moment: the camera counts as another one from there on. Nothing unless the best of these explains far more than chance
/// would and the move is more than 5 mm or 0.2 degrees. `solution` and `report` are those of adjust() with all pictures.
std::optional<MovedCamera> find_moved_camera(std::span<const Lens> lenses, const Board& board, std::span<const Sighting> sightings,
                                             const BundleSettings& settings, const BundleState& solution, const BundleReport& report);

}  // namespace booth::fit::calibrate

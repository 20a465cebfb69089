// The error of a calibration on views that it was not made from.
#pragma once

#include <span>
#include <vector>

#include "fit/calibrate/bundle.hpp"

namespace booth::fit::calibrate {

/// Of pictures that the fit had not seen. The board of a held-out view is placed by all its corners with the cameras held.
struct Errors {
  double reprojection_px = 0;  ///< root mean square over corners, per axis pair
  double corner_mm = 0;        ///< mean distance between the places that two cameras give a corner, each by its own ray and its own corrected depth
  double corner_p95_mm = 0;
  double plane_mm = 0;  ///< root mean square over pictures of the median distance between corrected depth and board
  int views = 0, pictures = 0;
  struct Camera {
    double reprojection_px = 0, corner_mm = 0, plane_mm = 0;
    int pictures = 0;
  };
  std::vector<Camera> camera;
};

/// Errors of `cameras` on those sightings for which `counts` is set (empty: all) and whose view two cameras saw. None of them may have served the fit.
Errors errors_on(std::span<const Lens> lenses, const Board& board, std::span<const Sighting> sightings, const BundleSettings& settings,
                 std::span<const char> counts, const BundleState& cameras);

/// Every view is left out once: as many fits as `folds`, each without every folds-th view of those that two cameras saw, judged on them. `solution` is that of
/// all views, from which each fit starts. Views whose absence leaves a camera without any are not judged.
Errors cross_validate(std::span<const Lens> lenses, const Board& board, std::span<const Sighting> sightings, const BundleSettings& settings,
                      std::span<const char> leave_out, const BundleState& solution, int folds);

}  // namespace booth::fit::calibrate

// From sightings of the board to cameras in the booth frame with an error that was measured, or to the sentence that says why not.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "fit/calibrate/hold_out.hpp"
#include "fit/calibrate/stage.hpp"

namespace booth::fit::calibrate {

enum class Refusal {
  none,
  no_board,         ///< nobody saw it
  mirrored_print,   ///< seen, but mirrored
  foreign_board,    ///< chessboards were seen that are not ours
  too_few_views,    ///< fewer views than needed, or cameras that no common view connects
  square_size,      ///< depth says that the squares have another size
  camera_moved,     ///< one camera stands elsewhere in the later views
  cameras_swapped,  ///< two cameras stand in each other's places
  no_floor,
  inaccurate,  ///< measured error beyond the limits
};
const char* to_string(Refusal refusal);

/// What a result may be wrong by, on views that were held out, and by its own covariance.
struct Limits {
  double reprojection_px = 0.6;
  double corner_mm = 15;
  double plane_mm = 6;
  double position_sd_mm = 4;
  double angle_sd_deg = 0.15;
  double square = 0.015;  ///< relative error of the squares' size
};

struct CalibrationInput {
  std::vector<std::string> names;  ///< of the cameras
  std::vector<Lens> lenses;
  std::vector<Rigid> expected;  ///< booth_from_camera where they should stand or stood; empty: not known
  Board board;
  int views = 0;
  std::vector<Sighting> sightings;                  ///< views counted in the order of time
  std::vector<std::vector<DepthSample>> room;       ///< of each camera: depth of the room around, for the floor
  int mirrored_pictures = 0, foreign_pictures = 0;  ///< pictures with a board that was not taken
  Needs needs;
  Limits limits;
  BundleSettings bundle;
};

struct CalibratedCamera {
  Rigid booth_from_camera;
  DepthCorrection depth;
  double position_sd_mm = 0, angle_sd_deg = 0;  ///< against the first camera, of which they are 0
  int pictures = 0;
};

struct Calibration {
  Refusal refusal = Refusal::none;
  std::string sentence;  ///< why it is refused and what to do; empty when it is not
  std::vector<CalibratedCamera> cameras;
  Errors errors;  ///< cross-validated
  Progress progress;
  double square_ratio = 1;  ///< size of the squares by depth against what they should be
  double floor_rms_mm = 0;
  bool origin_from_board = false;  ///< a board lay on the floor; otherwise the layout
  int left_out = 0;                ///< pictures that disagreed with all others
  std::vector<std::string> remarks;
  bool accepted() const { return refusal == Refusal::none; }
};

/// Throws std::invalid_argument when the input contradicts itself (numbers of cameras, views or corners). Seconds at most.
Calibration calibrate(const CalibrationInput& input);

/// One more view of the board against cameras that were calibrated before: errors and the sentence, by the same limits. `cameras` in the order of the input.
struct Verification {
  bool good = false;
  std::string sentence;
  Errors errors;
};
Verification verify(const CalibrationInput& input, std::span<const CalibratedCamera> cameras);

}  // namespace booth::fit::calibrate

// Finds the board where it lies flat on a floor that is known: too far away and too slanted for a finder that knows nothing of where it may be.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "daemon/calibrate/board_detector.hpp"
#include "fit/calibrate/lens.hpp"
#include "fit/calibrate/rigid.hpp"

namespace booth::daemon {

/// What one camera sees of the floor. Floor frame: z up and 0 on the floor, origin near the middle of the stage; metres.
struct FloorPicture {
  Grey16 infrared;
  fit::calibrate::Lens lens;
  fit::calibrate::Rigid camera_from_floor;
};

struct FloorBoard {
  fit::calibrate::Rigid floor_from_board;
  std::vector<double> likeness;  ///< of each picture: correlation of what it shows with the print, -1 to 1; 0 where the board lies outside it
};

struct FloorSearch {
  double reach = 1.0;     ///< metres around the floor's origin, each way
  double likeness = 0.6;  ///< what the best picture must show at least
  double margin = 0.12;   ///< by which the best place must be more alike than any other place or heading
};

/// The place and heading at which all pictures together look most like the print: a search in the floor's plan, then a refinement in the pictures. Cameras may
/// be misplaced by a centimetre or two. Nothing when no place is clearly the best. A fifth of a second; thread-safe.
std::optional<FloorBoard> find_board_on_floor(std::span<const FloorPicture> pictures, const fit::calibrate::Board& board, const FloorSearch& search = {});

}  // namespace booth::daemon

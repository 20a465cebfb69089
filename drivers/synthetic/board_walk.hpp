// Where a person who calibrates holds the board: one place for each view, as the guide asks.
#pragma once

#include <cstdint>
#include <vector>

#include "fit/calibrate/rigid.hpp"

namespace booth::drivers {

struct BoardWalk {
  int views = 24;        ///< held up, going round between neighbouring cameras
  bool on_floor = true;  ///< and one more, lying on the floor at the booth's origin, its arrow to the front
  double reach = 0.5;    ///< metres from the middle, at most
  std::uint64_t seed = 1;
};

/// booth_from_board of each view, for cameras at the corners of a square around the origin. The same walk gives the same places.
std::vector<fit::calibrate::Rigid> board_places(const BoardWalk& walk);

}  // namespace booth::drivers

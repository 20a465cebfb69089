// Finds the printed board in an infrared picture and its plane in the depth beside it: the only place that knows OpenCV.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>

#include "fit/calibrate/board_pose.hpp"

namespace booth::daemon {

/// A picture of one camera, row-major.
struct Grey16 {
  int width = 0, height = 0;
  std::span<const std::uint16_t> pixels;
};

struct BoardDetection {
  enum class Kind : std::uint8_t {
    none,      ///< no chessboard
    board,     ///< ours; the sighting is filled
    mirrored,  ///< ours, printed mirrored
    foreign,   ///< a chessboard, not ours
  };
  Kind kind = Kind::none;
  fit::calibrate::Sighting sighting;  ///< corners and pixels; view and camera are the caller's to set
};

/// Any part of the board that shows 4 x 3 inner corners or more will do. Pixel (0, 0) is the centre of the first one. Some tenths of a second; thread-safe.
/// Throws std::invalid_argument unless the picture has as many pixels as it says, 16 to 4096 each way.
BoardDetection detect_board(const Grey16& infrared);

/// The board where the caller knows it to be: `corners` are the pixels of all its inner corners to about a third of a square, in the order of their numbers.
/// What the picture does not show there is left out; nothing when 4 x 3 corners are not left. For boards that detect_board() cannot see: squares of six pixels.
/// Throws as detect_board().
std::optional<fit::calibrate::Sighting> sight_board_at(const Grey16& infrared, const Eigen::Matrix2Xd& corners);

/// Depth on the white cells of a sighted board, at most a hundred samples: white paper is what a time-of-flight camera measures best. `metres` a count.
/// Leaves the sighting without depth where its pose cannot be found or the picture has another size than the lens.
void add_board_depth(const Grey16& depth, double metres, const fit::calibrate::Lens& lens, const fit::calibrate::Board& board,
                     fit::calibrate::Sighting& sighting);

/// Every n-th pixel's depth, for the floor: about `count` samples.
std::vector<fit::calibrate::DepthSample> room_depth(const Grey16& depth, double metres, const fit::calibrate::Lens& lens, int count);

}  // namespace booth::daemon

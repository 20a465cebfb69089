// Where a board is, from one picture of it: the start of everything else.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "fit/calibrate/board.hpp"
#include "fit/calibrate/lens.hpp"
#include "fit/calibrate/rigid.hpp"

namespace booth::fit::calibrate {

/// What a depth camera measured at a pixel: the ray (x, y, 1) of the pixel and metres along z.
struct DepthSample {
  double x, y, z;
};

/// One board in one picture.
struct Sighting {
  int view = 0;    ///< moments in the order of time
  int camera = 0;  ///< position in the list of lenses
  std::vector<int> corner;
  Eigen::Matrix2Xd pixel;          ///< of each corner
  std::vector<DepthSample> depth;  ///< on the board's white cells; may be empty
};

struct BoardPose {
  Rigid camera_from_board;
  double rms_px = 0;  ///< of the corners
};

/// A flat board seen from afar has two poses that fit almost alike; of those that fit the corners about as well as the best, the one whose plane agrees with
/// the measured depth is taken. Homography, then Levenberg-Marquardt through the lens. Nothing when fewer than six corners or corners on a line.
std::optional<BoardPose> pose_of_board(const Lens& lens, const Board& board, const Sighting& sighting);

/// Drops corners one by one, the worst first, while one is more than `stray_px` off where the pose of all others puts it and more than `least` are left: what a
/// finder took for a corner beside a shoe or a reflection. Returns how many went; the pose of those that stay is pose_of_board()'s.
int drop_strays(const Lens& lens, const Board& board, double stray_px, std::size_t least, Sighting& sighting);

/// Metres along z at which a ray meets the board's plane; NaN where it does not.
double depth_of_plane(const Rigid& camera_from_board, double x, double y);

}  // namespace booth::fit::calibrate

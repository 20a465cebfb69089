// A booth of pure geometry in which boards are shown: corners and depth with noise of known size, and the truth.
#pragma once

#include <random>
#include <vector>

#include "fit/calibrate/calibration.hpp"

namespace booth::tests {

struct BoardBoothSettings {
  double side = 3;             ///< metres between neighbouring cameras
  double corner_noise = 0.15;  ///< pixels
  double depth_noise = 0.004;  ///< metres, of one sample
  int views = 28;              ///< board held up between two neighbours, going round
  bool on_floor = true;        ///< one view more, with the board lying at the origin
  double square = 0.108;       ///< true size; what the calibration believes is Board's
  unsigned seed = 1;
};

/// What the cameras are in truth.
struct BoardBooth {
  std::vector<fit::calibrate::Rigid> booth_from_camera;
  std::vector<fit::calibrate::DepthCorrection> depth;
  std::vector<fit::calibrate::Rigid> booth_from_board;  ///< by view
};

/// Fills names, lenses, sightings, views and room of the input. `moved`, where not null, is another place of one camera from a view on.
struct Move {
  int camera, view;
  fit::calibrate::Rigid booth_from_camera;
};
fit::calibrate::CalibrationInput show_boards(const BoardBoothSettings& settings, BoardBooth& truth, const Move* move = nullptr);

/// A camera at a point that looks at another, upright.
fit::calibrate::Rigid looking(const Eigen::Vector3d& from, const Eigen::Vector3d& at);
fit::calibrate::Lens kinect_lens();

}  // namespace booth::tests

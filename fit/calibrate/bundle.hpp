// One adjustment of all cameras, boards and depth corrections to everything that was seen (docs/design/calibration.md).
#pragma once

#include <span>
#include <vector>

#include "fit/calibrate/board_pose.hpp"
#include "fit/calibrate/camera_graph.hpp"

namespace booth::fit::calibrate {

/// What a camera reads at true depth z: (1 + gain) z + offset.
struct DepthCorrection {
  double gain = 0;
  double offset = 0;  ///< metres
  double read(double z) const { return (1 + gain) * z + offset; }
  double true_depth(double reading) const { return (reading - offset) / (1 + gain); }
};

struct BundleState {
  std::vector<Rigid> camera;  ///< camera_from_base; the first is the base itself
  std::vector<Rigid> board;   ///< base_from_board, by view
  std::vector<DepthCorrection> depth;
};

struct BundleSettings {
  double corner_sigma = 0.15;  ///< pixels
  double depth_sigma = 0.004;  ///< metres, of a board's plane in one picture (its samples together)
  double depth_samples = 9;    ///< as how many independent measurements a picture's depth counts at most
  double gain_sigma = 0.01;    ///< what is known of a camera's depth beforehand
  double offset_sigma = 0.02;  ///< metres
  double robust = 2.5;         ///< standard deviations beyond which an observation loses its say (Huber)
  int iterations = 60;
};

struct BundleReport {
  bool converged = false;
  int iterations = 0;
  double cost = 0;             ///< robust sum of squares, in variances
  std::vector<double> rms_px;  ///< of each sighting's corners; infinite where the sighting took no part
  /// Of the camera poses in steps of `stepped()` (three turns, three shifts, first camera: zero), scaled by how well the corners really fit.
  Eigen::MatrixXd covariance;
};

/// Sightings whose view or camera has no start take no part, nor do those marked in `leave_out` (empty or one entry for each). Levenberg-Marquardt with
/// iteratively reweighted residuals; boards are eliminated (Schur complement). `state` begins where `start` says and ends at the solution.
BundleReport adjust(std::span<const Lens> lenses, const Board& board, std::span<const Sighting> sightings, const BundleSettings& settings,
                    std::span<const char> leave_out, BundleState& state);
/// A state from start_poses(); cameras without a start stand in the base and must not have sightings that take part.
BundleState state_of(const Start& start);

/// With cameras held: the board's pose of one view by the same residuals. `base_from_board` begins at a guess. Returns the cost.
double place_board(std::span<const Lens> lenses, const Board& board, std::span<const Sighting* const> sightings, const BundleSettings& settings,
                   const BundleState& cameras, Rigid& base_from_board);

}  // namespace booth::fit::calibrate

// Which cameras saw the board together, what is still weak, and first poses along the strongest links.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fit/calibrate/board_pose.hpp"

namespace booth::fit::calibrate {

/// Two cameras by their positions, first < second.
struct CameraPair {
  int first = 0, second = 0;
  int views = 0;       ///< that both saw
  double spread = 0;   ///< metres between the board's positions in those views, root mean square
  double variety = 0;  ///< radians between the board's attitudes in those views, root mean square
};

/// What a calibration needs at least; docs/design/calibration.md says why.
struct Needs {
  int pair_views = 4;
  double pair_spread = 0.15;  ///< metres
  int views = 10;             ///< that two cameras or more saw
};

/// All pairs of `cameras`, also those that saw nothing together. `poses[i]` belongs to `sightings[i]`.
std::vector<CameraPair> camera_pairs(int cameras, std::span<const Sighting> sightings, std::span<const BoardPose> poses);
bool is_strong(const CameraPair& pair, const Needs& needs);

struct Progress {
  int views = 0;                 ///< seen by two cameras or more
  std::vector<CameraPair> weak;  ///< pairs that would help most, the most urgent first; empty: enough
  bool connected = false;        ///< strong pairs connect all cameras
  bool enough = false;           ///< connected, no camera hangs on a single pair (from three cameras on), and views are enough
};
/// A camera needs strong pairs with two others. `neighbours` (may be empty) are pairs that the layout makes likely; they are asked for first.
Progress progress(int cameras, std::span<const CameraPair> pairs, int views, const Needs& needs, std::span<const std::pair<int, int>> neighbours);

/// Poses of cameras (camera_from_base, the base is the first camera) and of boards (base_from_board, by view) along the links with most views. Each link is
/// the relative pose that most of its views agree on, so that a few wrong ones do no harm. Nothing for cameras and views that no link reaches.
struct Start {
  std::vector<std::optional<Rigid>> camera, board;
};
Start start_poses(int cameras, int views, std::span<const Sighting> sightings, std::span<const BoardPose> poses);

}  // namespace booth::fit::calibrate

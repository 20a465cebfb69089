// What can be said before anything is judged: which sightings are of use, where cameras stand to each other, and the floor below them.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "fit/calibrate/calibration.hpp"

namespace booth::fit::calibrate {

/// Sightings that have a pose, and the poses.
struct Usable {
  std::vector<Sighting> sightings;
  std::vector<BoardPose> poses;
};
Usable usable(const CalibrationInput& in);

/// All room points in the base, depth corrected; metres.
std::vector<Eigen::Vector3d> room_points(const CalibrationInput& in, const BundleState& x);
/// Where the cameras' centres lie in the base.
std::vector<Eigen::Vector3d> centres(const BundleState& x);
/// Cameras hang upright or nearly so, and their boards were held up: up is what is up in their pictures.
Eigen::Vector3d rough_up(const BundleState& x);

/// Booth_from_camera of every camera as well as the views so far tell it, to find a board on the floor by: z up and 0 on the measured floor, origin and front
/// by the plan. Nothing where views do not connect all cameras, no floor is seen, or nobody knows a plan. Nothing is judged.
std::optional<std::vector<Rigid>> rough_places(const CalibrationInput& in);

}  // namespace booth::fit::calibrate

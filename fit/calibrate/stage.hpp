// From where the cameras stand among themselves to where they stand in the booth: the floor, the way up, the origin and the front.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "fit/calibrate/rigid.hpp"

namespace booth::fit::calibrate {

/// normal . p = height; unit normal that points up.
struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double height = 0;  ///< metres
  double above(const Eigen::Vector3d& p) const { return normal.dot(p) - height; }
};

struct FloorFit {
  Plane plane;
  double rms = 0;  ///< metres, of the points that count as floor
  int points = 0;
};

/// The plane below all cameras with most points on it and hardly any below it, within 35 degrees of `up`; fixed random numbers, so the same points give the
/// same plane. Nothing when no plane holds a twentieth of the points (at least 200).
std::optional<FloorFit> find_floor(std::span<const Eigen::Vector3d> points, const Eigen::Vector3d& up, std::span<const Eigen::Vector3d> cameras);

/// The booth frame from a board that lies on the floor: origin in its middle, x along its arrow.
Rigid booth_from_board_on_floor(const Plane& floor, const Rigid& base_from_board);

/// The booth frame in which camera centres come nearest to where they are expected (turned about the vertical and shifted along the floor); `found` in the
/// base, `expected` in the booth, the same cameras in the same order, at least two.
Rigid booth_from_layout(const Plane& floor, std::span<const Eigen::Vector3d> found, std::span<const Eigen::Vector3d> expected);

/// Pairs of cameras that stand in each other's places: `found` (a frame whose z is up and 0 on the floor) fits `expected` within half a metre when the two are
/// exchanged, after a turn about the vertical of at most `most_turn` radians, and does not fit as it is after any turn. Where cameras stand in a square and the
/// front is not known, exchanging one diagonal looks like exchanging the other: then both are named. Empty: they fit as they are, or no exchange helps.
std::vector<std::pair<int, int>> exchanged_cameras(std::span<const Eigen::Vector3d> found, std::span<const Eigen::Vector3d> expected, double most_turn);

/// Any frame on the floor: z up, 0 on it.
Rigid level_on(const Plane& floor);

}  // namespace booth::fit::calibrate

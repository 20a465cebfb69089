// A motion as a sequence of q, and the smooth curve through it that a scene evaluates at each camera's own instant.
#pragma once

#include <vector>

#include "fit/body/skeleton.hpp"

namespace booth::drivers {

struct Motion {
  std::vector<fit::PoseVector> frames;  ///< q as in MATH.md 1; at least one
  double rate = 30;                     ///< frames per second
  bool cyclic = false;                  ///< the last frame leads into the first; otherwise the motion is played to and fro

  double seconds() const { return static_cast<double>(frames.size() - 1) / rate; }
  /// Cubic through the neighbouring frames; defined for every t >= 0. Thread-safe, allocates nothing, same bits on every machine.
  fit::PoseVector at(double t) const;
};

struct PlacementOptions {
  bool keep_path = false;   ///< leave the translation as it is
  double leg_scale = 1;     ///< the body's leg length over the skeleton's that the motion was made for
  double stage_radius = 1;  ///< beyond it the horizontal path is folded back, metres
};

/// A body's bones and the points of its soles that can touch the floor.
struct Contact {
  fit::Points3 bone_vectors = fit::average_bone_vectors();
  struct Point {
    int bone;
    Eigen::Vector3d offset;  ///< from the bone's start, in the frame in which the bone is at rest at q = 0
  };
  std::vector<Point> soles;  ///< empty: the ends of the foot bones
};

/// Lowest point of the feet in pose q, metres above y = 0.
double lowest_foot(const fit::PoseVector& q, const Contact& contact);

/// Puts a recorded motion on the stage: path recentred, scaled by the leg length and folded back beyond the radius (a treadmill), the
/// clip's lowest foot on the floor. With keep_path nothing changes.
void place_on_stage(Motion& motion, const Contact& contact, const PlacementOptions& options);

}  // namespace booth::drivers

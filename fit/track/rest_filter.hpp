// Steadies what is published of a person who stands still, and lets every real movement through at once.
#pragma once

#include "fit/body/skeleton.hpp"

namespace booth::fit {

/// A first-order low-pass over the published pose whose share of the new frame grows from kLeast to 1 with the largest change of any unknown, in units of
/// what the fit's own noise changes between two frames (kNoiseTurn, kNoiseMove). From that change on nothing is held back, so a movement is late by at most
/// as much as is noise: a degree. The follower itself never sees the filtered pose. No clock: one call a frame. Deterministic; allocates nothing.
class RestFilter {
 public:
  static constexpr double kLeast = 0.3;                          ///< share of the newest frame at perfect rest
  static constexpr double kNoiseTurn = 0.02, kNoiseMove = 0.01;  ///< rad, m

  /// The next pose comes out as it is.
  void reset() { has_pose_ = false; }
  /// The pose to publish for `q`.
  const PoseVector& next(const PoseVector& q);

 private:
  PoseVector pose_ = PoseVector::Zero();
  bool has_pose_ = false;
};

}  // namespace booth::fit

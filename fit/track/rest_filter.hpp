// Steadies what is published of a person who stands still, and lets every real movement through at once.
#pragma once

#include "fit/body/skeleton.hpp"

namespace booth::fit {

/// A first-order low-pass over the published pose. Its share of the newest frame grows from kLeast at perfect rest to 1 where any joint is kMove from where it
/// was published last, or any angle kTurn: then nothing is held back. So no joint is ever late by kMove, 0.36 m/s pass without any delay, and the follower
/// itself never sees the filtered pose. No clock: one call a frame. Deterministic; allocates nothing.
class RestFilter {
 public:
  static constexpr double kLeast = 0.3;
  static constexpr double kMove = 0.012;  ///< m; noise of the fit moves the worst joint by about a third of it
  static constexpr double kTurn = 0.10;   ///< rad; turns about a limb's own axis move no joint, and are noisier

  /// The next pose comes out as it is.
  void reset() { has_pose_ = false; }
  /// The pose to publish for `q`, of a body with these bones (as forward_kinematics() takes them).
  const PoseVector& next(const PoseVector& q, const Points3& bone_vectors);

 private:
  PoseVector pose_ = PoseVector::Zero();
  bool has_pose_ = false;
};

}  // namespace booth::fit

// Puts cameras right by somebody who moves before them, measures the result on frames that it was not made from, and says whether it is better.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "daemon/config/config.hpp"
#include "daemon/drivers_factory.hpp"

namespace booth::daemon {

struct RefinementInput {
  std::function<DepthSource()> open;              ///< the recording from its beginning; called once for each pass
  std::vector<hal::CameraDescription> cameras;    ///< where the calibration has the source's cameras, in the source's order
  Config config;                                  ///< models, stage, fit
  int passes = 5;                                 ///< at most, the one that measures the calibration as it is included
  std::function<void(const std::string&)> say{};  ///< a line on each pass; may be empty
};

struct RefinedCamera {
  double displacement = 0, deviation = 0;  ///< metres, root mean square over a person, between the old place and the new one, and how well that is known
  double turn = 0, shift = 0;              ///< radians and metres between the old place and the new one
  double late = 0, late_deviation = 0;     ///< seconds to be taken off its time stamps, besides what was taken off before
};

struct PersonRefinement {
  bool better = false;
  std::string sentence;                         ///< what was found; where it is not better, why
  std::vector<hal::CameraDescription> cameras;  ///< refined
  std::vector<RefinedCamera> change;
  /// Of frames that served no estimate: mean distance (m) of the person's points to the fitted surface, and what the cameras' points are off by at most (m).
  double residual_before = 0, residual_after = 0, disagreement_before = 0, disagreement_after = 0;
  double gain = 0, gain_deviation = 0;  ///< of the residual, over stretches of two seconds; metres
  int held_out_frames = 0, passes = 0;
  double seconds = 0;  ///< of a followed person
};

/// Every second stretch of two seconds is held out. The fit and the cameras are refined in turn, each from the other, until nothing moves any more.
/// Throws what opening and fitting throw, and std::runtime_error where the source's cameras are not as many as `cameras`.
PersonRefinement refine_from_person(const RefinementInput& input);

}  // namespace booth::daemon

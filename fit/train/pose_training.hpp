// From motion sequences to the pose prior: the whole of `boothctl model train-pose` without its files.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "fit/prior/pose_prior.hpp"

namespace booth::fit::train {

/// A gap-free piece of motion: columns [start, start + frames) of a sequence at 30 frames a second.
struct MotionSegment {
  int start = 0, frames = 0;
  int stride = 1;  ///< every how manieth frame counts for poses (speeds always use all): thins out what is over-represented
};

struct PoseTrainingSettings {
  std::uint64_t seed = 1;
  double kept_variance = 0.95;
  double speed_margin = 1.5;                   ///< factor on the 99 % speeds
  int clusters = 108, standing_clusters = 16;  ///< medoids; each is joined by its mirror image
};

/// `frames`: 36 x N, q of each frame. Every segment counts together with its mirror image. Throws std::invalid_argument when there is too little.
PosePrior train_pose_prior(const Eigen::MatrixXf& frames, const std::vector<MotionSegment>& segments, const PoseTrainingSettings& settings);

/// Lifts or lowers a pose of the average skeleton so that its lowest joint lies 2 cm above y = 0, the convention of the motion files.
PoseVector on_the_floor(PoseVector q);

}  // namespace booth::fit::train

// How far the fitted skeleton and surface were from the truth, where it is known.
#pragma once

#include <cstdint>
#include <vector>

#include "daemon/pipeline/frame_record.hpp"
#include "daemon/record/session_files.hpp"
#include "hal/ground_truth.hpp"

namespace booth::daemon {

/// Metres. Joint errors are over the 15 main joints of every frame in which the person was seen and the truth is known.
struct TruthError {
  std::uint64_t frames = 0;
  double joint_mean = 0, joint_p95 = 0;
  double joint_mean_settled = 0;       ///< of the frames after the body was accepted
  double joint_mean_all = 0;           ///< over all 24 joints
  std::vector<double> per_joint_mean;  ///< 24
  std::uint64_t surface_frames = 0;    ///< every 10th frame, at most 300 evenly spread
  double surface_mean = 0;             ///< mean of the two directions, both weighted by area
  double fitted_to_truth = 0, truth_to_fitted = 0;
};

/// Off the frame path: takes about 10 ms for each surface frame.
TruthError truth_error(const std::vector<FrameRecord>& frames, const SessionModels& models, const hal::GroundTruth& truth);

}  // namespace booth::daemon

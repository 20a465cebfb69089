// A recording fitted again exactly as it was live: the same groups of the same frames in the same order.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "daemon/pipeline/frame_fitter.hpp"
#include "hal/depth_camera.hpp"
#include "hal/flight_recorder.hpp"

namespace booth::daemon {

struct ReplayCounters {
  std::uint64_t groups = 0;     ///< fitted again
  std::uint64_t identical = 0;  ///< of them, with the very bits that were found live
  std::uint64_t skipped = 0;    ///< before a session's beginning, or after a frame that the recording lost: their predecessors are not known
};

/// `groups` as recorded, `to_live` what makes the cameras' time stamps those of the live booth. A session is replayed from its first group on. Throws
/// std::runtime_error when a camera cannot start or is lost.
ReplayCounters run_replay(hal::DepthCameras& cameras, const std::vector<hal::FittedGroup>& groups, hal::Nanoseconds to_live, FrameFitter& fitter,
                          const std::function<void(const FitInput&, const FrameRecord&)>& each);

}  // namespace booth::daemon

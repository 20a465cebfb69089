// The same fit on a finite source, in the order of time and with nothing dropped: what `boothctl track` and the fit signature run.
#pragma once

#include <functional>

#include "daemon/pipeline/frame_fitter.hpp"
#include "daemon/pipeline/synchroniser.hpp"
#include "hal/depth_camera.hpp"

namespace booth::daemon {

struct OfflineCounters {
  std::uint64_t groups = 0, frames = 0, frames_unmatched = 0, groups_small = 0;
};

/// Starts the cameras, reads them in step by the frames' own times, and hands each group to `fitter`; after each, `each` sees the input and the record and
/// returns false to end early. Groups with fewer than `minimum_cameras` are left out. The result depends on the frames alone. Throws std::runtime_error
/// when a camera cannot start or is lost.
OfflineCounters run_offline(hal::DepthCameras& cameras, int minimum_cameras, FrameFitter& fitter,
                            const std::function<bool(const FitInput&, const FrameRecord&)>& each);

}  // namespace booth::daemon

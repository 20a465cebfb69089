// Views of the board straight from the cameras: looks again and again, takes what is worth taking, and tells the person who holds it what to do.
#pragma once

#include <functional>
#include <string>

#include "daemon/calibrate/capture_flow.hpp"
#include "daemon/calibrate/view_collector.hpp"
#include "hal/clock.hpp"
#include "hal/depth_camera.hpp"

namespace booth::daemon {

/// After each look.
struct CaptureNews {
  CaptureCue cue = CaptureCue::search;
  int taken = 0;                  ///< views so far
  std::vector<std::string> seen;  ///< names of the cameras that see the board now
  std::string next;               ///< where to hold it, or what else to do; empty when all is there
};

struct LiveCaptureSettings {
  fit::calibrate::Board board;
  fit::calibrate::Needs needs;
  CaptureRules rules;
  double give_up_seconds = 600;  ///< without a new view
};

struct LiveCaptureHooks {
  std::function<void(const CaptureNews&)> news;                             ///< on the caller's thread; must not throw
  std::function<void(int view, const std::vector<hal::DepthFrame>&)> view;  ///< a view was taken; may be empty
  std::function<bool()> stop = [] { return false; };                        ///< true: enough, go on with what there is
};

/// Starts the cameras, captures until views are enough and one of them lay on the floor (or `stop`), and stops the cameras. One thread a camera reads; the
/// caller's looks. Throws std::runtime_error when a camera is lost or has no infrared, or nothing new came for `give_up_seconds`.
ViewCollector capture_live(hal::DepthCameras& cameras, hal::Clock& clock, const LiveCaptureSettings& settings, const LiveCaptureHooks& hooks);

}  // namespace booth::daemon

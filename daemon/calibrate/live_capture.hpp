// Views of the board straight from the cameras: looks again and again, takes what is worth taking, and tells the person who holds it what to do.
#pragma once

#include <functional>
#include <string>

#include "daemon/calibrate/capture_flow.hpp"
#include "daemon/calibrate/view_collector.hpp"
#include "hal/clock.hpp"
#include "hal/depth_camera.hpp"

namespace booth::daemon {

/// Where a capture gets its pictures from.
class FrameFeed {
 public:
  virtual ~FrameFeed() = default;
  /// As the cameras are described now: where they should stand.
  virtual std::vector<hal::CameraDescription> cameras() const = 0;
  /// A frame of each camera, infrared included, taken after the last call; those that have none within `timeout` are left out. Throws std::runtime_error when
  /// it makes no sense to wait any longer.
  virtual std::vector<hal::DepthFrame> take(hal::Nanoseconds timeout) = 0;
  /// Names of the cameras that deliver nothing at present.
  virtual std::vector<std::string> silent() const { return {}; }
};

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
  double floor_seconds = 120;    ///< after all else is there: for the board on the floor. Then the origin is the plan's
  int most_views = 80;           ///< more are not asked for, however uncertain the result
};

struct LiveCaptureHooks {
  std::function<void(const CaptureNews&)> news;                             ///< on the caller's thread; must not throw
  std::function<void(int view, const std::vector<hal::DepthFrame>&)> view;  ///< a view was taken; may be empty
  std::function<bool()> stop = [] { return false; };                        ///< true: enough, go on with what there is
};

/// Captures until the views make a calibration that is accepted and one of them lay on the floor, and ends by itself in any case: where more views cannot mend
/// what is wrong (calibrate() says it then), where nobody lays the board on the floor for `floor_seconds`, or where `stop` says so. Throws std::runtime_error
/// when the feed does, when a camera has no infrared, or when nothing new came for `give_up_seconds` and views are too few.
ViewCollector capture_live(FrameFeed& feed, hal::Clock& clock, const LiveCaptureSettings& settings, const LiveCaptureHooks& hooks);

/// The same from cameras of one's own: starts them, one thread each reads, and stops them. A camera that is lost ends the capture.
ViewCollector capture_live(hal::DepthCameras& cameras, hal::Clock& clock, const LiveCaptureSettings& settings, const LiveCaptureHooks& hooks);

}  // namespace booth::daemon

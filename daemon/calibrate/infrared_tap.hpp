// Pictures for a calibration while the pipeline goes on reading the cameras: around each camera, so that neither knows of the other.
#pragma once

#include <atomic>
#include <memory>

#include "daemon/calibrate/live_capture.hpp"
#include "daemon/calibrate/newest_frames.hpp"

namespace booth::daemon {

/// Outlives the cameras that it has wrapped. While it is closed, which it is at first, it costs nothing and frames hold no infrared.
class InfraredTap final : public FrameFeed {
 public:
  /// Each camera is replaced by one that hands its frames on. Before anybody reads them, and before others wrap them who should not see infrared.
  void wrap(hal::DepthCameras& cameras);

  /// From any thread; not while somebody takes.
  void open();
  void close();

  std::vector<hal::CameraDescription> cameras() const override { return cameras_; }
  std::vector<hal::DepthFrame> take(hal::Nanoseconds timeout) override;
  std::vector<std::string> silent() const override;

 private:
  friend class TappedInfrared;
  std::shared_ptr<NewestFrames> newest() const { return newest_.load(); }

  std::vector<hal::CameraDescription> cameras_;
  std::atomic<std::shared_ptr<NewestFrames>> newest_;  ///< null: closed
};

}  // namespace booth::daemon

// Where the flight recorder hears what passes: around each camera and around the fitter, so that the pipeline knows nothing of it.
#pragma once

#include <memory>

#include "daemon/pipeline/frame_fitter.hpp"
#include "hal/depth_camera.hpp"
#include "hal/flight_recorder.hpp"

namespace booth::daemon {

/// Hands every frame that is read to the recorder; all else is the camera's. The recorder outlives it.
std::unique_ptr<hal::DepthCamera> tap_camera(std::unique_ptr<hal::DepthCamera> camera, hal::CameraIndex index, hal::FlightRecorder& recorder);
/// All of them.
void tap_cameras(hal::DepthCameras& cameras, hal::FlightRecorder& recorder);

/// Hands every fitted group to the recorder; all else is the fitter's, which outlives it, as the recorder does.
class TappedFitter final : public FrameFitter {
 public:
  TappedFitter(FrameFitter& fitter, hal::FlightRecorder& recorder) : fitter_(fitter), recorder_(recorder) {}
  void reset() override { fitter_.reset(); }
  void step(const FitInput& input, FrameRecord& out) override;
  const char* remark() const override { return fitter_.remark(); }
  std::vector<MemoryItem> memory_plan() const override { return fitter_.memory_plan(); }
  BackendStatus backend() const override { return fitter_.backend(); }
  std::vector<CameraDriftStatus> drift() const override { return fitter_.drift(); }

 private:
  FrameFitter& fitter_;
  hal::FlightRecorder& recorder_;
};

}  // namespace booth::daemon

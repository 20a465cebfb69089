// Each wrapper does what it wraps does, and tells the recorder.
#include "daemon/record/booth_tap.hpp"

#include "hal/wrapped_camera.hpp"

namespace booth::daemon {
namespace {

class TappedCamera final : public hal::WrappedCamera {
 public:
  TappedCamera(std::unique_ptr<hal::DepthCamera> camera, hal::CameraIndex index, hal::FlightRecorder& recorder)
      : WrappedCamera(std::move(camera)), index_(index), recorder_(recorder) {}

  hal::ReadStatus read(hal::DepthFrame& slot, hal::Nanoseconds timeout) override {
    const hal::ReadStatus status = WrappedCamera::read(slot, timeout);
    if (status == hal::ReadStatus::frame) {
      slot.camera = index_;
      recorder_.frame(slot);
    }
    return status;
  }

 private:
  const hal::CameraIndex index_;
  hal::FlightRecorder& recorder_;
};

}  // namespace

std::unique_ptr<hal::DepthCamera> tap_camera(std::unique_ptr<hal::DepthCamera> camera, hal::CameraIndex index, hal::FlightRecorder& recorder) {
  return std::make_unique<TappedCamera>(std::move(camera), index, recorder);
}

void tap_cameras(hal::DepthCameras& cameras, hal::FlightRecorder& recorder) {
  for (std::size_t i = 0; i < cameras.size(); ++i) cameras[i] = tap_camera(std::move(cameras[i]), static_cast<hal::CameraIndex>(i), recorder);
}

void TappedFitter::step(const FitInput& input, FrameRecord& out) {
  fitter_.step(input, out);
  static_assert(kMaxCameras <= static_cast<int>(hal::kMostRecordedCameras) && kRecordDofs == static_cast<int>(hal::kRecordedDofs));
  hal::FittedGroup group;
  group.sequence = input.frame;
  group.reference = input.reference;
  for (std::size_t c = 0; c < input.frames.size(); ++c)
    if (input.frames[c]) group.captured[c] = input.frames[c]->captured;
  group.person = out.person != PersonState::lost;
  group.q = out.q;
  recorder_.fitted(group);
}

}  // namespace booth::daemon

// A constant is taken off; order and distances of the frames stay.
#include "drivers/pacing/punctual_camera.hpp"

#include "hal/wrapped_camera.hpp"

namespace booth::drivers {
namespace {

class PunctualCamera final : public hal::WrappedCamera {
 public:
  PunctualCamera(std::unique_ptr<hal::DepthCamera> camera, hal::Nanoseconds late) : WrappedCamera(std::move(camera)), late_(late) {}

  hal::ReadStatus read(hal::DepthFrame& slot, hal::Nanoseconds timeout) override {
    const hal::ReadStatus status = WrappedCamera::read(slot, timeout);
    if (status == hal::ReadStatus::frame) slot.captured -= late_;
    return status;
  }

 private:
  const hal::Nanoseconds late_;
};

}  // namespace

std::unique_ptr<hal::DepthCamera> punctual(std::unique_ptr<hal::DepthCamera> camera, hal::Nanoseconds late) {
  if (late == hal::Nanoseconds{}) return camera;
  return std::make_unique<PunctualCamera>(std::move(camera), late);
}

}  // namespace booth::drivers

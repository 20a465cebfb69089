// A constant is taken off; order and distances of the frames stay.
#include "drivers/pacing/punctual_camera.hpp"

namespace booth::drivers {
namespace {

class PunctualCamera final : public hal::DepthCamera {
 public:
  PunctualCamera(std::unique_ptr<hal::DepthCamera> camera, hal::Nanoseconds late) : camera_(std::move(camera)), late_(late) {}

  const hal::CameraDescription& description() const override { return camera_->description(); }
  void start() override { camera_->start(); }
  void stop() noexcept override { camera_->stop(); }
  hal::ReadStatus read(hal::DepthFrame& slot, hal::Nanoseconds timeout) override {
    const hal::ReadStatus status = camera_->read(slot, timeout);
    if (status == hal::ReadStatus::frame) slot.captured -= late_;
    return status;
  }
  hal::CameraCounters counters() const override { return camera_->counters(); }
  std::string last_error() const override { return camera_->last_error(); }

 private:
  const std::unique_ptr<hal::DepthCamera> camera_;
  const hal::Nanoseconds late_;
};

}  // namespace

std::unique_ptr<hal::DepthCamera> punctual(std::unique_ptr<hal::DepthCamera> camera, hal::Nanoseconds late) {
  if (late == hal::Nanoseconds{}) return camera;
  return std::make_unique<PunctualCamera>(std::move(camera), late);
}

}  // namespace booth::drivers

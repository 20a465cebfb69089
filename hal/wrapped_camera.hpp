// A camera around another one: the many wrappers that only add to what is read need not repeat the rest.
#pragma once

#include <memory>
#include <string>
#include <utility>

#include "hal/depth_camera.hpp"

namespace booth::hal {

/// Does what the camera within does; read() is for the wrapper to add to. Threads as DepthCamera says.
class WrappedCamera : public DepthCamera {
 public:
  explicit WrappedCamera(std::unique_ptr<DepthCamera> camera) : camera_(std::move(camera)) {}

  const CameraDescription& description() const override { return camera_->description(); }
  void start() override { camera_->start(); }
  void stop() noexcept override { camera_->stop(); }
  ReadStatus read(DepthFrame& slot, Nanoseconds timeout) override { return camera_->read(slot, timeout); }
  CameraCounters counters() const override { return camera_->counters(); }
  DecodeStatus decoding() const override { return camera_->decoding(); }
  std::string last_error() const override { return camera_->last_error(); }

 private:
  const std::unique_ptr<DepthCamera> camera_;
};

}  // namespace booth::hal

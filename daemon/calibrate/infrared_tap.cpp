// A slot gets a buffer for infrared before it is read into, and gives it back before the pipeline sees it.
#include "daemon/calibrate/infrared_tap.hpp"

#include "hal/wrapped_camera.hpp"

namespace booth::daemon {

class TappedInfrared final : public hal::WrappedCamera {
 public:
  TappedInfrared(std::unique_ptr<hal::DepthCamera> camera, hal::CameraIndex index, const InfraredTap& tap)
      : WrappedCamera(std::move(camera)), index_(index), tap_(tap) {}

  hal::ReadStatus read(hal::DepthFrame& slot, hal::Nanoseconds timeout) override {
    const auto newest = tap_.newest();
    if (!newest) {
      infrared_ = {};
      return WrappedCamera::read(slot, timeout);
    }
    const auto& k = description().intrinsics;
    infrared_.resize(static_cast<std::size_t>(k.width) * static_cast<std::size_t>(k.height));  // once in each calibration; nobody is captured then
    slot.infrared.swap(infrared_);
    const hal::ReadStatus status = WrappedCamera::read(slot, timeout);
    if (status == hal::ReadStatus::frame) {
      slot.camera = index_;
      newest->put(slot);
    }
    slot.infrared.swap(infrared_);
    return status;
  }

 private:
  const hal::CameraIndex index_;
  const InfraredTap& tap_;
  std::vector<std::uint16_t> infrared_;
};

void InfraredTap::wrap(hal::DepthCameras& cameras) {
  cameras_.clear();
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    cameras_.push_back(cameras[i]->description());
    cameras[i] = std::make_unique<TappedInfrared>(std::move(cameras[i]), static_cast<hal::CameraIndex>(i), *this);
  }
}

void InfraredTap::open() { newest_.store(std::make_shared<NewestFrames>(cameras_.size())); }
void InfraredTap::close() { newest_.store({}); }

std::vector<hal::DepthFrame> InfraredTap::take(hal::Nanoseconds timeout) {
  const auto newest = newest_.load();
  return newest ? newest->take(timeout) : std::vector<hal::DepthFrame>{};
}

std::vector<std::string> InfraredTap::silent() const {
  std::vector<std::string> out;
  if (const auto newest = newest_.load())
    for (const std::size_t c : newest->silent()) out.push_back(cameras_[c].name);
  return out;
}

}  // namespace booth::daemon

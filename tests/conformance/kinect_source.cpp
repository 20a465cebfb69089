// Stepping, end of scene and the pace of several cameras, around the driver's own cameras.
#include "tests/conformance/kinect_source.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>

#include "drivers/kinect2/emulator/scene_view.hpp"
#include "drivers/kinect2/kinect_camera.hpp"
#include "drivers/pacing/timeline.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;
namespace kinect2 = drivers::kinect2;

class SteppedCamera final : public hal::DepthCamera {
 public:
  SteppedCamera(std::unique_ptr<hal::DepthCamera> camera, std::shared_ptr<kinect2::emulator::EmulatedBus> bus, std::shared_ptr<drivers::Timeline> timeline,
                int lane, int frames)
      : camera_(std::move(camera)), bus_(std::move(bus)), timeline_(std::move(timeline)), lane_(lane), frames_(frames) {}

  const hal::CameraDescription& description() const override { return camera_->description(); }
  void start() override {
    camera_->start();
    timeline_->enter(lane_);
    running_ = true;
  }
  void stop() noexcept override {
    running_ = false;
    timeline_->leave(lane_);
    camera_->stop();
  }
  hal::ReadStatus read(hal::DepthFrame& slot, hal::Nanoseconds timeout) override {
    if (!running_ || next_ >= frames_) return hal::ReadStatus::ended;
    switch (timeline_->wait(lane_, next_ * kPeriod, 0ns, timeout)) {
      case drivers::Timeline::Wait::timeout:
        return hal::ReadStatus::timeout;
      case drivers::Timeline::Wait::stopped:
        return hal::ReadStatus::ended;
      case drivers::Timeline::Wait::due:
        break;
    }
    bus_->step(lane_);
    const auto status = camera_->read(slot, 30s);
    if (status != hal::ReadStatus::frame) return status;
    ++next_;
    timeline_->advance(lane_, next_ * kPeriod, next_ >= frames_);
    return status;
  }
  hal::CameraCounters counters() const override { return camera_->counters(); }
  std::string last_error() const override { return camera_->last_error(); }

 private:
  static constexpr hal::Nanoseconds kPeriod{33'333'333};
  const std::unique_ptr<hal::DepthCamera> camera_;
  const std::shared_ptr<kinect2::emulator::EmulatedBus> bus_;
  const std::shared_ptr<drivers::Timeline> timeline_;
  const int lane_, frames_;
  int next_ = 0;
  std::atomic<bool> running_{false};
};

}  // namespace

drivers::Source open_kinect_scene(drivers::SceneSettings settings, drivers::Person person, drivers::Pace pace, std::shared_ptr<hal::Clock> clock, int frames) {
  const bool stepped = pace == drivers::Pace::fast;
  auto scene = kinect2::emulator::make_emulated_scene(std::move(settings), {std::move(person)}, 30, clock, stepped);
  drivers::Source source;
  source.truth = scene.truth;
  source.background = std::move(scene.background);
  const auto lanes = static_cast<int>(scene.cameras.size());
  const auto timeline = std::make_shared<drivers::Timeline>(pace, clock, lanes, 66'666'666ns);
  kinect2::KinectShared shared{.bus = scene.bus, .clock = clock, .gate = std::make_shared<kinect2::ResetGate>(0ns)};
  for (int i = 0; i < lanes; ++i) {
    const auto& place = scene.cameras[static_cast<std::size_t>(i)];
    // Walls of the scene are further away than the sensor's usual range.
    auto camera = kinect2::make_kinect_camera(shared, {.index = hal::CameraIndex(static_cast<std::uint8_t>(i)),
                                                       .serial = place.serial,
                                                       .name = place.name,
                                                       .camera_to_world = place.camera_to_world,
                                                       .decoder = {.maximum_depth = 8.0}});
    source.cameras.push_back(stepped ? std::make_unique<SteppedCamera>(std::move(camera), scene.bus, timeline, i, frames) : std::move(camera));
  }
  return source;
}

}  // namespace booth::tests

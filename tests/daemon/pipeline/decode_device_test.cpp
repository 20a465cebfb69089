// A booth whose cameras' depth is decoded on a graphics processor (emulated here): it fails in every way and comes back; frames, status and events meanwhile.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>

#include "daemon/ctl/control_protocol.hpp"
#include "daemon/pipeline/pipeline.hpp"
#include "daemon/session/controller.hpp"
#include "drivers/clock/system_clock.hpp"
#include "drivers/kinect2/decoder/device/emulated_device.hpp"
#include "drivers/kinect2/decoder/guarded_decoder.hpp"
#include "drivers/kinect2/emulator/scene_view.hpp"
#include "drivers/kinect2/kinect_camera.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using gpu::DeviceError;
namespace kinect2 = drivers::kinect2;

constexpr double kRate = 8;  // frames per second of each sensor: the emulated kernels are slow

struct DecodeBooth : ::testing::TestWithParam<DeviceError> {
  void build() {
    drivers::SceneSettings scene;
    scene.cameras = drivers::camera_ring(2);
    auto emulated = kinect2::emulator::make_emulated_scene(std::move(scene), {}, kRate, clock);
    kinect2::KinectShared shared{.bus = emulated.bus, .clock = clock};
    shared.decoder = [this](const auto& camera, const auto& phase, const auto& settings) {
      return kinect2::make_guarded_decoder(camera, phase, settings, [this](std::string&) { return kinect2::device::make_emulated_device(faults); },
                                           {.first_wait = 5ms, .longest_wait = 20ms});
    };
    kinect2::Patience patience;
    patience.stall = 60s;  // a loaded machine is slow
    for (const auto& camera : emulated.cameras)
      cameras.push_back(kinect2::make_kinect_camera(shared, {.index = hal::CameraIndex(static_cast<std::uint8_t>(cameras.size())),
                                                             .serial = camera.serial,
                                                             .name = "c" + std::to_string(cameras.size()),
                                                             .nominal_rate = kRate,
                                                             .patience = patience}));
    ControllerSettings c;
    c.session_directory = folder.path;
    c.on_event = [this](const std::string& kind, const std::string& source, const std::string& text) {
      const std::lock_guard lock(mutex);
      if (source == "cameras" && text.rfind("depth of", 0) == 0) events.push_back(kind + ": " + text);
    };
    controller = std::make_unique<Controller>(c, *clock);
    pipeline = std::make_unique<Pipeline>(Pipeline::Settings{.minimum_cameras = 1, .synchroniser = {}}, cameras, *clock, fitter, *controller);
    controller->run(*pipeline, fitter, nullptr);
  }
  void TearDown() override {
    if (controller) controller->shutdown("test");
    pipeline.reset();
  }
  std::vector<std::string> said() {
    const std::lock_guard lock(mutex);
    return events;
  }
  /// Of both cameras.
  bool both(const std::function<bool(const CameraStatus&)>& have) const {
    return tests::eventually(
        [&] {
          const auto all = controller->status().cameras;
          return all.size() == 2 && std::all_of(all.begin(), all.end(), have);
        },
        120s);
  }
  bool frames_go_on() const {
    std::vector<std::uint64_t> before;
    for (const auto& c : controller->status().cameras) before.push_back(c.counters.delivered);
    return both([&](const CameraStatus& c) { return c.counters.delivered >= before.at(c.name == "c0" ? 0 : 1) + 2; });
  }
  nlohmann::json decoder_json() const {
    return nlohmann::json::parse(status_json(controller->status())).at("cameras").at(0).value("decoder", nlohmann::json());
  }

  std::shared_ptr<hal::Clock> clock = std::make_shared<drivers::SystemClock>();
  tests::TemporaryFolder folder;
  gpu::Faults faults;
  hal::DepthCameras cameras;
  tests::FakeFitter fitter;
  std::mutex mutex;
  std::vector<std::string> events;
  std::unique_ptr<Controller> controller;
  std::unique_ptr<Pipeline> pipeline;
};

TEST_P(DecodeBooth, GoesOnWithoutTheDeviceAndTakesItBack) {
  build();
  ASSERT_TRUE(frames_go_on());
  EXPECT_TRUE(both([](const CameraStatus& c) { return c.decoding.name == "device emulated" && c.decoding.problem.empty(); }));
  EXPECT_EQ(decoder_json()["name"], "device emulated");
  EXPECT_TRUE(said().empty());
  faults.at_start = DeviceError::absent;  // and away for a while
  faults.error = GetParam();
  faults.runs_left = 0;
  ASSERT_TRUE(both([](const CameraStatus& c) { return c.decoding.losses == 1; }));
  ASSERT_TRUE(frames_go_on());
  EXPECT_TRUE(
      both([](const CameraStatus& c) { return c.decoding.name.rfind("cpu ", 0) == 0 && !c.decoding.problem.empty() && c.state == CameraState::running; }));
  EXPECT_NE(decoder_json()["problem"], "");
  ASSERT_TRUE(tests::eventually([&] { return said().size() == 2; }, 120s));
  for (const std::string& event : said()) EXPECT_EQ(event.rfind("fault: depth of camera c", 0), 0u) << event;
  const int tried = faults.starts;
  ASSERT_TRUE(tests::eventually([&] { return faults.starts >= tried + 2; }, 120s)) << "nobody tries the device again";
  EXPECT_EQ(said().size(), 2u) << "a device that is tried in vain is no news";
  faults.runs_left = -1;
  faults.at_start = DeviceError::none;
  ASSERT_TRUE(both([](const CameraStatus& c) { return c.decoding.name == "device emulated" && c.decoding.problem.empty(); }));
  ASSERT_TRUE(frames_go_on());
  EXPECT_TRUE(tests::eventually(
      [&] {
        const auto all = said();
        return std::count_if(all.begin(), all.end(), [](const std::string& e) { return e.rfind("state: depth of camera c", 0) == 0; }) >= 2;
      },
      120s));
}

INSTANTIATE_TEST_SUITE_P(Kinds, DecodeBooth, ::testing::Values(DeviceError::lost, DeviceError::late, DeviceError::absent, DeviceError::out_of_memory),
                         [](const auto& kind) {
                           return std::string(kind.param == DeviceError::lost     ? "Reset"
                                              : kind.param == DeviceError::late   ? "Hang"
                                              : kind.param == DeviceError::absent ? "Removed"
                                                                                  : "Memory");
                         });

struct DecodeStart : DecodeBooth {};

TEST_P(DecodeStart, DecodesOnTheCpuWhereTheDeviceIsNotToBeHad) {
  faults.at_start = GetParam();
  build();
  ASSERT_TRUE(frames_go_on());
  EXPECT_TRUE(both([](const CameraStatus& c) { return c.decoding.name.rfind("cpu ", 0) == 0 && c.decoding.losses == 0; }));
  EXPECT_NE(decoder_json()["problem"].get<std::string>().find(to_string(GetParam())), std::string::npos);
  ASSERT_TRUE(tests::eventually([&] { return said().size() == 2; }, 120s));
  EXPECT_EQ(said().front().rfind("fault: depth of camera c", 0), 0u) << said().front();
}

INSTANTIATE_TEST_SUITE_P(Kinds, DecodeStart, ::testing::Values(DeviceError::out_of_memory, DeviceError::absent),
                         [](const auto& kind) { return std::string(kind.param == DeviceError::absent ? "Absent" : "Memory"); });

}  // namespace
}  // namespace booth::daemon

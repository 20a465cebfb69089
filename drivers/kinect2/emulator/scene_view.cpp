// From the HAL's picture (not mirrored, counts) to the device's (mirrored, millimetres and brightness).
#include "drivers/kinect2/emulator/scene_view.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2::emulator {
namespace {

/// Brightness of skin and cloth at one metre; it falls with the square of the distance.
constexpr float kBrightness = 20000.0f, kDarkest = 400.0f, kBrightest = 20000.0f;

}  // namespace

EmulatedSensors make_emulated_sensors(drivers::SceneSettings settings, std::vector<drivers::Person> persons, double rate, std::shared_ptr<hal::Clock> clock) {
  if (settings.cameras.empty()) settings.cameras = camera_ring();
  EmulatedSensors scene;
  for (std::size_t i = 0; i < settings.cameras.size(); ++i) {
    auto& camera = settings.cameras[i];
    if (camera.intrinsics.width != kWidth || camera.intrinsics.height != kHeight)
      throw std::invalid_argument("camera '" + camera.name + "' of an emulated scene must have 512 x 424 pixels, as the sensor has");
    camera.depth_scale = 0.0001;  // finer than the sensor's own noise
    camera.serial = "00000000000" + std::to_string(i + 1);
  }
  scene.cameras = settings.cameras;
  // Noise is the renderer's: the scene's setting stands for the whole sensor.
  const std::uint64_t seed = settings.seed;
  SceneViews views = make_scene_views(std::move(settings), std::move(persons), std::move(clock));
  scene.truth = std::move(views.truth);
  for (auto& frame : views.background) {
    for (auto& count : frame.depth) count = static_cast<std::uint16_t>((count + 5) / 10);
    scene.background.push_back(std::move(frame));
  }
  for (std::size_t i = 0; i < scene.cameras.size(); ++i) {
    auto picture = std::make_shared<std::vector<std::uint16_t>>(kPixels);
    auto look = views.cameras[i];
    View view = [look, picture](hal::MonotonicTime at, std::span<float> depth, std::span<float> infrared) {
      look(at, *picture);
      for (int r = 0; r < kHeight; ++r)
        for (int c = 0; c < kWidth; ++c) {
          const auto from = static_cast<std::size_t>(r * kWidth + kWidth - 1 - c), to = static_cast<std::size_t>(r * kWidth + c);
          const float z = 0.1f * static_cast<float>((*picture)[from]);
          const float metres = 0.001f * z;
          depth[to] = z;
          infrared[to] = z > 0 ? std::clamp(kBrightness / (metres * metres), kDarkest, kBrightest) : 0.0f;
        }
    };
    scene.devices.push_back({.serial = scene.cameras[i].serial,
                             .rate = rate,
                             .seed = seed + i,
                             .camera = mirrored_parameters(scene.cameras[i].intrinsics),
                             .view = std::move(view)});
  }
  return scene;
}

EmulatedScene make_emulated_scene(drivers::SceneSettings settings, std::vector<drivers::Person> persons, double rate, std::shared_ptr<hal::Clock> clock,
                                  bool stepped) {
  EmulatedScene scene;
  scene.bus = make_emulated_bus(clock);
  EmulatedSensors sensors = make_emulated_sensors(std::move(settings), std::move(persons), rate, std::move(clock));
  for (auto& device : sensors.devices) {
    device.stepped = stepped;
    scene.bus->add(std::move(device));
  }
  scene.cameras = std::move(sensors.cameras);
  scene.truth = std::move(sensors.truth);
  scene.background = std::move(sensors.background);
  return scene;
}

}  // namespace booth::drivers::kinect2::emulator

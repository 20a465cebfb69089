// The embedded booth for the real driver: emulated sensors that see the simulated scene.
#pragma once

#include <memory>
#include <vector>

#include "drivers/kinect2/emulator/emulated_bus.hpp"
#include "drivers/synthetic/scene.hpp"

namespace booth::drivers::kinect2::emulator {

/// What the sensors of a scene are, whatever bus they are plugged into: device i stands at place i.
struct EmulatedSensors {
  std::vector<EmulatedDeviceSettings> devices;
  std::vector<hal::CameraDescription> cameras;  ///< with the serials of the devices
  std::shared_ptr<const hal::GroundTruth> truth;
  std::vector<hal::DepthFrame> background;
};

/// One sensor for each camera of the scene (empty: the ring of four), each with the lens that the camera is said to have. Scene time begins now.
/// Throws std::invalid_argument where a camera has not the sensor's 512 x 424 pixels.
EmulatedSensors make_emulated_sensors(drivers::SceneSettings settings, std::vector<drivers::Person> persons, double rate, std::shared_ptr<hal::Clock> clock);

struct EmulatedScene {
  std::shared_ptr<EmulatedBus> bus;
  std::vector<hal::CameraDescription> cameras;  ///< with the serials of the emulated devices, device i of the bus at place i
  std::shared_ptr<const hal::GroundTruth> truth;
  std::vector<hal::DepthFrame> background;
};

/// make_emulated_sensors() plugged into an emulated bus of the process.
/// `stepped`: frames are sent by the bus's step(), in scene time from Timeline::kFastOrigin on.
EmulatedScene make_emulated_scene(drivers::SceneSettings settings, std::vector<drivers::Person> persons, double rate, std::shared_ptr<hal::Clock> clock,
                                  bool stepped = false);

}  // namespace booth::drivers::kinect2::emulator

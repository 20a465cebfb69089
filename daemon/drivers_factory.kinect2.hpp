// The part of the drivers factory that opens Kinect v2 sensors, real or emulated.
#pragma once

#include <memory>

#include "daemon/drivers_factory.hpp"
#include "drivers/synthetic/scene.hpp"

namespace booth::daemon {

/// The sensors of cameras.kinect2.serials. Throws std::runtime_error naming the sensor and the remedy.
DepthSource open_kinect(const Config& config, std::shared_ptr<hal::Clock> clock);

#ifdef BOOTHD_EMULATOR
/// The same driver on emulated sensors that see this person in the simulated room.
DepthSource open_emulated_kinect(const Config& config, drivers::Person person, std::shared_ptr<hal::Clock> clock);
#endif

}  // namespace booth::daemon

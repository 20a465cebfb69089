// The conformance scene seen by emulated Kinect v2 through the real driver.
#pragma once

#include <memory>

#include "drivers/source.hpp"
#include "drivers/synthetic/scene.hpp"
#include "hal/clock.hpp"

namespace booth::tests {

/// At Pace::own the sensors run free, as they do in a booth. At Pace::fast each read lets its sensor take one more picture, so that nothing depends on how busy
/// the host is, no camera runs more than two frames ahead of another, and the scene ends after `frames` (a sensor never does).
drivers::Source open_kinect_scene(drivers::SceneSettings settings, drivers::Person person, drivers::Pace pace, std::shared_ptr<hal::Clock> clock, int frames);

}  // namespace booth::tests

// Takes the delay that is known of a camera off its time stamps, so that whoever comes after it need not know of it.
#pragma once

#include <memory>

#include "hal/depth_camera.hpp"

namespace booth::drivers {

/// `late`: by how much the camera's `captured` lies behind the middle of the exposure; negative where it lies before. All else is the camera's.
std::unique_ptr<hal::DepthCamera> punctual(std::unique_ptr<hal::DepthCamera> camera, hal::Nanoseconds late);

}  // namespace booth::drivers

// calibration.toml as a file of its own: which cameras there are, and where they stand.
#pragma once

#include <filesystem>
#include <vector>

#include "hal/depth_frame.hpp"

namespace booth::drivers {

/// The [[camera]] tables in their order. Throws std::runtime_error naming file, line and key.
std::vector<hal::CameraDescription> read_calibration(const std::filesystem::path& file);

}  // namespace booth::drivers

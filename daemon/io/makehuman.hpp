// Reads the CC0 morphable body of the MakeHuman project from a folder (base.obj, targets/, rigs/) into memory for training.
#pragma once

#include <filesystem>

#include "fit/train/base_body.hpp"

namespace booth::daemon {

/// Throws std::runtime_error that names file, line and remedy. Files are decimetres; the result is metres.
fit::train::BaseBody load_makehuman(const std::filesystem::path& directory);

}  // namespace booth::daemon

// Which files a booth that changes hands must not take along: calibration and credentials.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "daemon/config/config.hpp"

namespace booth::daemon {

/// Files that exist: the calibration and those that were before it; credentials under their known names where dds.credentials, dds.self_issued and
/// CREDENTIALS beside the configuration `file` are. Nothing else of these folders, whatever they are set to.
std::vector<std::filesystem::path> key_files(const Config& config, const std::filesystem::path& file);

/// Deletes a file. Throws std::runtime_error naming it.
void forget(const std::filesystem::path& path);

/// Removes the folders of a self-issued fleet that are empty, so that boothd can make another. Returns the sentence to print where something is left in them;
/// empty when nothing is.
std::string forget_empty_fleet(const Config& config);

}  // namespace booth::daemon

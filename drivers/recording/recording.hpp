// Opening and writing recordings, whatever their layout: a folder of 16-bit PNGs or a rosbag2 folder (docs/reference/recordings.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "drivers/source.hpp"
#include "drivers/truth_body.hpp"
#include "hal/clock.hpp"
#include "hal/depth_sink.hpp"

namespace booth::drivers {

enum class Layout : std::uint8_t { folder, rosbag2 };

/// The layout is told by the files: metadata.yaml is rosbag2, calibration.toml a folder. Frames are read from disk as they are asked for;
/// one that is missing or broken counts as dropped or corrupt. Throws std::runtime_error naming the file, the place and the remedy.
Source open_recording(const std::filesystem::path& path, Pace pace, std::shared_ptr<hal::Clock> clock, TruthSurface surface = {});

/// Writes beside `path` under a temporary name; close() gives it its name. `path` must not exist. `body` is the truth's, where known.
/// `background` holds frames of the empty booth (any camera, any number) to be stored as such. `compressed`: of a rosbag2, images are packed without loss.
/// Throws std::runtime_error naming the path and the remedy.
std::unique_ptr<hal::DepthSink> create_recording(const std::filesystem::path& path, Layout layout, const std::vector<hal::CameraDescription>& cameras,
                                                 const std::optional<TruthBody>& body = {}, const std::vector<hal::DepthFrame>& background = {},
                                                 bool compressed = false);

}  // namespace booth::drivers

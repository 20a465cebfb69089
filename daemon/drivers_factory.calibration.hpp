// What the calibration needs from the drivers: camera tables, 16-bit pictures, and simulated cameras that see a board.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/record/calibration_used.hpp"
#include "hal/clock.hpp"
#include "hal/depth_camera.hpp"
#include "hal/depth_frame.hpp"

namespace booth::drivers {
struct CalibrationNotes;
}

namespace booth::daemon {

/// The [[camera]] tables of a calibration.toml. Throws std::runtime_error naming file, line and key.
std::vector<hal::CameraDescription> read_cameras(const std::filesystem::path& file);
/// The same of text that was read from a file of that name.
std::vector<hal::CameraDescription> read_cameras(const std::string& text, const std::filesystem::path& name);
/// Seconds by which each camera's time stamps lie behind its exposures, as the file's `time_offset_ms` have it. Throws the same.
std::vector<double> read_time_offsets(const std::filesystem::path& file);
/// What a session says of the calibration `file`, whose reader noted `notes`. With `written`, for files that are written where they are used, one that does not
/// say when it was measured is as old as the file; a copy's time would say nothing.
CalibrationUsed calibration_used(const std::filesystem::path& file, const drivers::CalibrationNotes& notes, bool written);
/// When that was, UTC nanoseconds since 1970; 0 where it is not known.
std::int64_t calibrated_utc_ns(const CalibrationUsed& calibration);
/// The same cameras with so many seconds taken off their time stamps; `late` has one for each.
hal::DepthCameras punctual_cameras(hal::DepthCameras cameras, const std::vector<double>& late);
/// A calibration with the line that says what its other bytes sum up to; one that was there is replaced.
std::string with_checksum(const std::string& text);
/// One [[camera]] table; keys may be appended. `folder` empty: none is named.
std::string camera_table(const hal::CameraDescription& camera, const std::string& folder = {});

/// A 16-bit grey PNG of this size; nothing when there is no such file. Throws std::runtime_error when it is broken or of another size.
std::optional<std::vector<std::uint16_t>> read_picture(const std::filesystem::path& file, int width, int height);
void write_picture(const std::filesystem::path& file, int width, int height, const std::vector<std::uint16_t>& pixels);

/// Somebody who walks through a simulated booth of four cameras and shows the board.
struct SimulatedViews {
  double square = 0.108;  ///< metres
  int views = 24;         ///< held up; one more lies on the floor
  std::string noise = "kinect2";
  std::uint64_t seed = 1;
  double side = 4;  ///< metres between neighbouring cameras
};
/// The cameras as the plan has them (the first vector) and as they really hang, some centimetres and degrees beside it (the second).
struct SimulatedCameras {
  std::vector<hal::CameraDescription> planned, real;
};
SimulatedCameras simulated_cameras(std::uint64_t seed, double side = 4);
/// Gives the frames of a view, infrared included, one for each camera; views are numbered from 0 to `views` (the last one: on the floor). One thread at a
/// time. Throws std::invalid_argument naming the setting.
std::function<std::vector<hal::DepthFrame>(int view)> simulated_views(const SimulatedViews& settings);

/// The same booth live: cameras that deliver infrared, and the person who moves on when he is told that a view was taken.
struct SimulatedCalibration {
  std::shared_ptr<hal::Clock> clock;
  hal::DepthCameras cameras;
  std::function<void()> move_on;
};
SimulatedCalibration open_simulated_calibration(const SimulatedViews& settings, double rate);

}  // namespace booth::daemon

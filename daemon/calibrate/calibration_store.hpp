// calibration.toml with what was measured: the last good one stays until a better one is whole, and those before it are kept.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "fit/calibrate/calibration.hpp"
#include "hal/depth_frame.hpp"

namespace booth::daemon {

/// A calibration as it is stored.
struct CalibrationRecord {
  std::vector<hal::CameraDescription> cameras;  ///< with names, serials and intrinsics; places are those of `result` when it is written
  fit::calibrate::Calibration result;           ///< accepted
  std::string utc, by, software;                ///< when ("2026-11-28T09:00:00Z"), who, what made it
  double square = 0;                            ///< metres
  int views = 0;
  std::vector<double>
      late{};  ///< seconds, of each camera (time_offset_ms); empty: store_calibration() takes over what the file before says of the same sensors
};

/// The file's text. Numbers are written so that reading them gives the same bits.
std::string calibration_text(const CalibrationRecord& record);

/// Replaces `file` in one step; what stood there is kept beside it as NAME.before-<its time>.toml, the last ten of those. Throws std::runtime_error.
void store_calibration(const std::filesystem::path& file, const CalibrationRecord& record);

/// The same with a text that was made otherwise. What is written has a checksum, whether `text` has or not.
void replace_calibration(const std::filesystem::path& file, const std::string& text);

/// Gives a file that somebody has edited its checksum; the file must be one that can be read. Throws std::runtime_error.
void confirm_calibration(const std::filesystem::path& file);

/// Puts the newest of those that were kept and can be read in the file's place, which is kept as NAME.replaced.toml. Returns which. Throws std::runtime_error.
std::filesystem::path restore_calibration(const std::filesystem::path& file);

/// What a file says of the cameras and their depth; files without depth keys (written by hand) have none. Throws std::runtime_error naming file and key.
struct StoredCalibration {
  std::vector<hal::CameraDescription> cameras;
  std::vector<fit::calibrate::CalibratedCamera> calibrated;
  std::optional<double> square;  ///< metres
  std::string utc, by;
};
StoredCalibration load_calibration(const std::filesystem::path& file);

}  // namespace booth::daemon

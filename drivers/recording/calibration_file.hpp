// calibration.toml as a file of its own: which cameras there are, and where they stand.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "hal/depth_frame.hpp"

namespace booth::drivers {

/// What this program writes as a file's `version`; a file without one is of version 1.
inline constexpr std::int64_t kCalibrationVersion = 1;

/// What a reader may want to know of a file besides its cameras.
struct CalibrationNotes {
  std::vector<std::string> newer;  ///< sentences about a file of the next version, of which things are passed over
  std::string checksum;            ///< "crc64:...", and right; empty: the file was edited, or written by an older program
  std::string utc;                 ///< `calibration.utc`, when it was measured; empty: not said
  /// `calibration.held_out.corner_mm`, `corner_p95_mm` and `plane_mm` (docs/design/calibration.md), in metres; negative: not said, or no length.
  double held_out_corner = -1, held_out_corner_p95 = -1, held_out_plane = -1;
};

/// The [[camera]] tables in their order. Throws std::runtime_error naming file, line and key; also where the file has a checksum and was changed since.
/// Of a file of the next version what is not known is passed over.
std::vector<hal::CameraDescription> read_calibration(const std::filesystem::path& file, CalibrationNotes* notes = nullptr);

/// `time_offset_ms` of each table, in seconds: by how much the camera's time stamps lie behind its exposures; 0 where it is not said. Throws the same.
std::vector<double> read_time_offsets(const std::filesystem::path& file);

/// What a camera's table says besides its description; both may be empty.
struct CalibrationFiles {
  std::string folder;                   ///< of its pictures
  std::vector<std::string> background;  ///< pictures of the empty room
};

/// The same from text; `name` is for the errors.
std::vector<hal::CameraDescription> parse_calibration_text(const std::string& text, const std::filesystem::path& name);

/// What write_calibration() writes.
std::string calibration_text(const std::vector<hal::CameraDescription>& cameras, const std::vector<CalibrationFiles>& files = {});

/// Numbers are written so that reading them gives the same bits. `files` is empty or has one entry for each camera. Throws std::runtime_error.
void write_calibration(const std::filesystem::path& file, const std::vector<hal::CameraDescription>& cameras, const std::vector<CalibrationFiles>& files = {});

/// One [[camera]] table, for a file that says more than that; `folder` empty: none is named. Keys may be appended.
std::string camera_table_text(const hal::CameraDescription& camera, const std::string& folder = {});

}  // namespace booth::drivers

// Writes refined places and delays into a calibration file, leaving all else of it, comments included, as it is.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "daemon/calibrate/person_refinement.hpp"

namespace booth::daemon {

struct RefinementOrigin {
  std::string utc, by, software;  ///< as in CalibrationRecord
  std::string recording;          ///< its name
};

/// The file's text with the new places and `time_offset_ms` (of cameras that the refinement has, told by their names), calibration.utc where there is one, and
/// a
/// [[refinement]] table at its end that says where they come from. Throws std::runtime_error naming file and key.
std::string refined_calibration_text(const std::filesystem::path& file, const PersonRefinement& refinement, const RefinementOrigin& origin);

/// Replaces the file, keeping what stood in it as store_calibration() does. Throws std::runtime_error; std::invalid_argument where the refinement is not
/// better.
void store_refined_calibration(const std::filesystem::path& file, const PersonRefinement& refinement, const RefinementOrigin& origin);

}  // namespace booth::daemon

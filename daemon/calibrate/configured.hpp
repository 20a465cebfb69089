// From configuration to what boothd's own calibration needs.
#pragma once

#include <string>

#include "daemon/calibrate/booth_calibration.hpp"
#include "daemon/calibrate/infrared_tap.hpp"
#include "daemon/config/config.hpp"

namespace booth::daemon {

/// The board that cameras.board and cameras.board_square_mm name.
fit::calibrate::Board board_of(const Config& config);

/// The tap outlives the calibration.
BoothCalibrationSettings calibration_settings(const Config& config, InfraredTap& tap, const std::string& software);

}  // namespace booth::daemon

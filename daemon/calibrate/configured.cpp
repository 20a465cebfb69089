// Two keys and a driver.
#include "daemon/calibrate/configured.hpp"

namespace booth::daemon {

fit::calibrate::Board board_of(const Config& config) {
  if (config.cameras.board_square_mm > 0) return {config.cameras.board_square_mm / 1000};
  return {fit::calibrate::find_paper(config.cameras.board)->square / 1000};
}

BoothCalibrationSettings calibration_settings(const Config& config, InfraredTap& tap, const std::string& software) {
  BoothCalibrationSettings out;
  out.file = config.cameras.kinect2.calibration;
  if (config.cameras.driver != "kinect2") out.cannot = "only real Kinect v2 sensors are calibrated; cameras.driver is " + config.cameras.driver;
  out.capture.board = board_of(config);
  out.capture.give_up_seconds = 300;  // a booth that waits for an installer who has gone serves nobody
  out.software = software;
  out.open = [&tap] { tap.open(); };
  out.close = [&tap] { tap.close(); };
  return out;
}

}  // namespace booth::daemon

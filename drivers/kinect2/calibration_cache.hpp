// What was once read from a sensor, kept on disk: it never changes in the field, and reading it again is 1.3 MB and a risk at each start.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "drivers/kinect2/calibration.hpp"

namespace booth::drivers::kinect2 {

/// One file for each serial and firmware, with a checksum; written so that a power cut leaves the old or the new. Thread-safe for different serials.
class CalibrationCache {
 public:
  explicit CalibrationCache(std::filesystem::path folder) : folder_(std::move(folder)) {}
  /// Nothing when there is none, when it is damaged, of another version or out of range: then the device is asked again.
  std::optional<Calibration> load(const std::string& serial, const std::string& firmware) const;
  /// Of whatever firmware, the one written last: for a start without the device.
  std::optional<Calibration> load_latest(const std::string& serial) const;
  /// False when it could not be written (full or read-only disk): the device is asked again next time.
  bool store(const Calibration& calibration) const noexcept;

 private:
  std::filesystem::path file_of(const std::string& serial, const std::string& firmware) const;
  std::optional<Calibration> read(const std::filesystem::path& file) const;
  const std::filesystem::path folder_;
};

}  // namespace booth::drivers::kinect2

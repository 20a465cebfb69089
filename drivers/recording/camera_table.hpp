// One [[camera]] table of a calibration.toml, read with errors that name the file, the line and the key.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "drivers/recording/calibration_file.hpp"
#include "drivers/recording/toml_document.hpp"
#include "hal/depth_frame.hpp"

namespace booth::drivers {

/// A view of the file's name and of the table, which must outlive it. All members throw std::runtime_error.
class CameraTable {
 public:
  CameraTable(const std::filesystem::path& file, const toml::table& table, std::size_t index) : file_(file), table_(table), index_(index) {}

  [[noreturn]] void wrong(const char* key, const std::string& what) const;
  double number(const char* key) const;
  double number(const char* key, double otherwise) const { return has(key) ? number(key) : otherwise; }
  int whole(const char* key) const;
  std::string text(const char* key, const std::string& otherwise) const;
  const toml::array& array(const char* key, std::size_t size) const;
  bool has(const char* key) const { return table_.contains(key); }
  const toml::table& table() const { return table_; }
  /// What the table says of the camera itself, checked; the rate is left at its default.
  hal::CameraDescription description() const;

 private:
  const std::filesystem::path& file_;
  const toml::table& table_;
  std::size_t index_;
};

/// A whole file, its version and its checksum looked at as read_calibration() does.
toml::table parse_calibration(const std::filesystem::path& file, CalibrationNotes* notes = nullptr);
std::vector<CameraTable> camera_tables(const std::filesystem::path& file, const toml::table& root);

}  // namespace booth::drivers

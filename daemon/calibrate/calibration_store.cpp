// TOML out through fmt, TOML in through toml++.
#include "daemon/calibrate/calibration_store.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <stdexcept>

#include "daemon/calibrate/view_collector.hpp"
#include "daemon/config/toml_document.hpp"
#include "daemon/config/toml_text.hpp"
#include "daemon/drivers_factory.calibration.hpp"
#include "daemon/io/atomic_file.hpp"
#include "daemon/io/backups.hpp"
#include "daemon/io/file_bytes.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
constexpr std::size_t kKept = 10;
constexpr std::size_t kLargest = 1u << 20;  // bytes of a calibration

/// What the backup of a file is called by: its own time where it has one that can be trusted, else the time it was written; 20261128T090000Z.
std::string time_of(const fs::path& file) {
  try {
    if (std::string utc = load_calibration(file).utc; utc.size() == 20) {
      std::erase_if(utc, [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); });
      return utc;
    }
  } catch (const std::exception&) {
    // Damaged: what it says of its time may be, too.
  }
  struct stat status {};
  std::tm utc{};
  char out[32] = "unknown";
  if (::stat(file.c_str(), &status) == 0 && ::gmtime_r(&status.st_mtime, &utc) != nullptr) std::strftime(out, sizeof out, "%Y%m%dT%H%M%SZ", &utc);
  return out;
}

/// Those before it, the oldest first.
std::vector<fs::path> backups_of(const fs::path& file) {
  const std::string stem = file.stem().string() + ".before-";
  std::vector<fs::path> kept;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(file.parent_path().empty() ? "." : file.parent_path(), error))
    if (const std::string name = entry.path().filename().string(); name.starts_with(stem) && name.ends_with(".toml")) kept.push_back(file.parent_path() / name);
  sort_backups(kept);
  return kept;
}

bool holds(const fs::path& file, const std::string& bytes) {
  try {
    return read_file_bytes(file, kLargest) == bytes;
  } catch (const std::exception&) {
    return false;
  }
}

void keep_old(const fs::path& file) {
  std::error_code error;
  if (!fs::exists(file, error)) return;
  const std::string stem = file.stem().string() + ".before-" + time_of(file);
  fs::path backup = file.parent_path() / (stem + ".toml");
  try {
    const std::string bytes = read_file_bytes(file, kLargest);
    // Two may have one time: copied from a template, or made while the clock stood still.
    for (int i = 2; fs::exists(fs::symlink_status(backup, error)) && !holds(backup, bytes); ++i)
      backup = file.parent_path() / fmt::format("{}-{:02}.toml", stem, i);
    write_file_atomically(backup, bytes);
  } catch (const std::exception& e) {
    throw std::runtime_error(fmt::format("the calibration before cannot be kept ({}); nothing was changed", e.what()));
  }
  keep_newest_backups(backups_of(file), backup, kKept);
}

}  // namespace

std::string calibration_text(const CalibrationRecord& r) {
  const auto& c = r.result;
  std::string out = fmt::format(
      "# Where the cameras stand, and how far this can be trusted (docs/guide/calibrate.md). Made by boothctl calibrate; rather make it anew than edit it.\n"
      "# World frame: x forward, y left, z up, metres, origin on the floor at the middle of the stage.\n"
      "version = 1\n\n[calibration]\nutc = {}\nby = {}\nsoftware = {}\nsquare_mm = {}\nviews = {}\npictures_left_out = {}\norigin = {}\nfloor_rms_mm = {}\n"
      "square_ratio = {}  # of the board's squares by depth to what they should be\n\n"
      "[calibration.held_out]  # errors on views that the fit had not seen\nviews = {}\npictures = {}\nreprojection_px = {}\ncorner_mm = {}  # between "
      "cameras\n"
      "corner_p95_mm = {}\nplane_mm = {}  # of corrected depth against the board\n",
      toml_string(r.utc), toml_string(r.by), toml_string(r.software), toml_float(1000 * r.square), r.views, c.left_out,
      toml_string(c.origin_from_board ? "board" : "layout"), toml_float(c.floor_rms_mm), toml_float(c.square_ratio), c.errors.views, c.errors.pictures,
      toml_float(c.errors.reprojection_px), toml_float(c.errors.corner_mm), toml_float(c.errors.corner_p95_mm), toml_float(c.errors.plane_mm));
  for (std::size_t i = 0; i < r.cameras.size(); ++i) {
    hal::CameraDescription camera = r.cameras[i];
    const auto& found = c.cameras[i];
    const auto& error = c.errors.camera[i];
    camera.camera_to_world = transform_of(found.booth_from_camera);
    camera.depth_gain = found.depth.gain, camera.depth_offset = found.depth.offset;
    out += camera_table(camera);
    out += fmt::format(
        "position_sd_mm = {}\nangle_sd_deg = {}\npictures = {}\n"
        "reprojection_px = {}\ncorner_mm = {}\nplane_mm = {}\n",
        toml_float(found.position_sd_mm), toml_float(found.angle_sd_deg), found.pictures, toml_float(error.reprojection_px), toml_float(error.corner_mm),
        toml_float(error.plane_mm));
    if (i < r.late.size() && r.late[i] != 0)
      out += fmt::format("time_offset_ms = {}  # its time stamps lie so far behind its exposures\n", toml_float(1e3 * r.late[i]));
  }
  return out;
}

namespace {

/// Where a camera stands says nothing of its clock: what a person has taught of that stays.
std::vector<double> offsets_before(const fs::path& file, const std::vector<hal::CameraDescription>& cameras) {
  std::vector<double> out(cameras.size(), 0.0);
  std::error_code error;
  if (!fs::exists(file, error)) return out;
  try {
    const auto before = read_cameras(file);
    const auto late = read_time_offsets(file);
    for (std::size_t i = 0; i < cameras.size(); ++i)
      for (std::size_t b = 0; b < before.size(); ++b)
        if (before[b].name == cameras[i].name && before[b].serial == cameras[i].serial) out[i] = late[b];
  } catch (const std::runtime_error&) {
    // A file that cannot be read is kept beside the new one, and teaches nothing.
  }
  return out;
}

}  // namespace

void store_calibration(const fs::path& file, const CalibrationRecord& given) {
  if (!given.result.accepted()) throw std::runtime_error("a calibration that was refused is not stored");
  CalibrationRecord record = given;
  if (record.late.empty()) record.late = offsets_before(file, record.cameras);
  replace_calibration(file, calibration_text(record));
}

void replace_calibration(const fs::path& file, const std::string& text) {
  keep_old(file);
  write_file_atomically(file, with_checksum(text));
}

void confirm_calibration(const fs::path& file) {
  (void)load_calibration(file);
  write_file_atomically(file, with_checksum(read_file_bytes(file, kLargest)));
}

fs::path restore_calibration(const fs::path& file) {
  const auto kept = backups_of(file);
  for (auto backup = kept.rbegin(); backup != kept.rend(); ++backup) {
    try {
      (void)load_calibration(*backup);
    } catch (const std::exception&) {
      continue;  // an older one may be whole
    }
    std::error_code error;
    if (fs::exists(file, error)) write_file_atomically(fs::path(file).replace_extension(".replaced.toml"), read_file_bytes(file, kLargest));
    write_file_atomically(file, read_file_bytes(*backup, kLargest));
    return *backup;
  }
  if (kept.empty()) throw std::runtime_error(fmt::format("{}: no calibration from before was kept beside it; calibrate anew", file.string()));
  throw std::runtime_error(fmt::format("{}: none of the {} calibrations that were kept beside it can be read; calibrate anew", file.string(), kept.size()));
}

StoredCalibration load_calibration(const fs::path& file) {
  StoredCalibration out;
  out.cameras = read_cameras(file);
  const toml::table root = parse_toml(read_file_bytes(file, kLargest), file.string());
  for (const auto& camera : out.cameras) {
    fit::calibrate::CalibratedCamera c;
    c.booth_from_camera = rigid_of(camera.camera_to_world);
    c.depth = {camera.depth_gain, camera.depth_offset};
    out.calibrated.push_back(c);
  }
  if (const auto square = root["calibration"]["square_mm"].value<double>(); square && *square > 1 && *square < 1000) out.square = *square / 1000;
  out.utc = root["calibration"]["utc"].value_or(std::string());
  out.by = root["calibration"]["by"].value_or(std::string());
  return out;
}

}  // namespace booth::daemon

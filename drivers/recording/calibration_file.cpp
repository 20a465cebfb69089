// Writing calibration.toml (docs/reference/recordings.md); camera_table.cpp reads it.
#include "drivers/recording/calibration_file.hpp"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "drivers/recording/text.hpp"

namespace booth::drivers {
namespace {

/// A TOML basic string.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (static_cast<unsigned char>(c) >= 0x20 && c != 0x7f) out += c;
  }
  return out + "\"";
}

/// A number that TOML reads as a float.
std::string real(double value) {
  std::string text = format_number(value);
  return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
}

void write_camera(std::ostream& out, const hal::CameraDescription& c, const CalibrationFiles* files) {
  const auto& k = c.intrinsics;
  out << "\n[[camera]]\nname = " << quoted(c.name) << "\nserial = " << quoted(c.serial);
  if (files) out << "\nfolder = " << quoted(files->folder);
  out << "\nwidth = " << k.width << "\nheight = " << k.height << "\nfx = " << real(k.fx) << "\nfy = " << real(k.fy) << "\ncx = " << real(k.cx)
      << "\ncy = " << real(k.cy) << "\ndistortion = [";
  for (std::size_t j = 0; j < 5; ++j) out << (j > 0 ? ", " : "") << real(k.distortion[j]);
  out << "]  # k1 k2 p1 p2 k3\ndepth_scale = " << real(c.depth_scale) << "  # metres per count; 0 = no measurement\nrate = " << real(c.nominal_rate);
  if (files) {
    out << "\nbackground = [";
    for (std::size_t j = 0; j < files->background.size(); ++j) out << (j > 0 ? ", " : "") << quoted(files->background[j]);
    out << "]  # the empty room";
  }
  if (c.depth_gain != 0 || c.depth_offset != 0)
    out << "\ndepth_gain = " << real(c.depth_gain) << "\ndepth_offset = " << real(c.depth_offset)
        << "  # it reads (1 + gain) z + offset metres at true depth z";
  out << "\ncamera_to_world = [\n";
  for (std::size_t r = 0; r < 3; ++r) {
    out << "  [";
    for (std::size_t j = 0; j < 3; ++j) out << real(c.camera_to_world.rotation[3 * r + j]) << ", ";
    out << real(c.camera_to_world.translation[r]) << "],\n";
  }
  out << "  [0.0, 0.0, 0.0, 1.0],\n]\n";
}

}  // namespace

std::string camera_table_text(const hal::CameraDescription& camera, const std::string& folder) {
  std::ostringstream out;
  const CalibrationFiles files{folder, {}};
  write_camera(out, camera, folder.empty() ? nullptr : &files);
  return out.str();
}

std::string calibration_text(const std::vector<hal::CameraDescription>& cameras, const std::vector<CalibrationFiles>& files) {
  std::ostringstream out;
  out << "# World frame: x forward, y left, z up, metres, origin on the floor at the middle of the stage.\nversion = 1\n";
  for (std::size_t i = 0; i < cameras.size(); ++i) write_camera(out, cameras[i], i < files.size() ? &files[i] : nullptr);
  return out.str();
}

void write_calibration(const std::filesystem::path& file, const std::vector<hal::CameraDescription>& cameras, const std::vector<CalibrationFiles>& files) {
  std::ofstream out(file);
  out << calibration_text(cameras, files);
  out.close();
  if (!out) throw std::runtime_error("cannot write " + file.string() + ": " + std::strerror(errno) + "; check the disk's space");
}

}  // namespace booth::drivers

// Reading the tables, and what any of them must hold.
#include "drivers/recording/camera_table.hpp"

#include <array>
#include <fstream>
#include <stdexcept>

#include "drivers/recording/calibration_checksum.hpp"
#include "drivers/recording/calibration_file.hpp"
#include "drivers/recording/layouts.hpp"
#include "hal/file_version.hpp"

namespace booth::drivers {
namespace {

constexpr std::size_t kMaxCameras = 64;

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& what) { throw std::runtime_error(file.string() + ": " + what); }

}  // namespace

void CameraTable::wrong(const char* key, const std::string& what) const {
  const toml::node* node = table_.get(key);
  const auto line = node != nullptr ? node->source().begin.line : table_.source().begin.line;
  fail(file_, "line " + std::to_string(line) + ": camera " + std::to_string(index_ + 1) + ", " + key + " " + what);
}

double CameraTable::number(const char* key) const {
  const auto value = table_[key].value<double>();
  if (!value) wrong(key, "must be a number");
  return *value;
}

int CameraTable::whole(const char* key) const {
  const auto value = table_[key].value<std::int64_t>();
  if (!value || *value < 0 || *value > 1'000'000) wrong(key, "must be a whole number from 0 to 1000000");
  return static_cast<int>(*value);
}

std::string CameraTable::text(const char* key, const std::string& otherwise) const {
  if (!table_.contains(key)) return otherwise;
  const auto value = table_[key].value<std::string>();
  if (!value) wrong(key, "must be text");
  return *value;
}

const toml::array& CameraTable::array(const char* key, std::size_t size) const {
  const auto* a = table_[key].as_array();
  if (a == nullptr || a->size() != size) wrong(key, "must be an array of " + std::to_string(size));
  return *a;
}

hal::CameraDescription CameraTable::description() const {
  hal::CameraDescription d;
  d.name = text("name", "camera-" + std::to_string(index_));
  d.serial = text("serial", "");
  auto& k = d.intrinsics;
  k.width = whole("width");
  k.height = whole("height");
  k.fx = number("fx");
  k.fy = number("fy");
  k.cx = number("cx");
  k.cy = number("cy");
  d.depth_scale = number("depth_scale", 0.001);
  d.depth_gain = number("depth_gain", 0);
  d.depth_offset = number("depth_offset", 0);
  if (has("distortion")) {
    const auto& a = array("distortion", 5);
    for (std::size_t i = 0; i < 5; ++i) {
      const auto value = a[i].value<double>();
      if (!value) wrong("distortion", "must hold five numbers: k1 k2 p1 p2 k3");
      k.distortion[i] = *value;
    }
  }
  const auto& rows = array("camera_to_world", 4);
  for (std::size_t r = 0; r < 4; ++r) {
    const auto* row = rows[r].as_array();
    if (row == nullptr || row->size() != 4) wrong("camera_to_world", "must be four rows of four numbers");
    for (std::size_t c = 0; c < 4; ++c) {
      const auto value = (*row)[c].value<double>();
      if (!value) wrong("camera_to_world", "must be four rows of four numbers");
      if (r == 3 && *value != (c == 3 ? 1.0 : 0.0)) wrong("camera_to_world", "must end with the row 0 0 0 1");
      if (r < 3 && c < 3) d.camera_to_world.rotation[3 * r + c] = *value;
      if (r < 3 && c == 3) d.camera_to_world.translation[r] = *value;
    }
  }
  check_description(d, file_.string());
  return d;
}

namespace {

constexpr std::uintmax_t kMaxBytes = 4 << 20;

std::string read_whole(const std::filesystem::path& file) {
  std::error_code error;
  // Not a pipe, which would be waited for.
  const bool regular = std::filesystem::is_regular_file(file, error);
  if (regular && std::filesystem::file_size(file, error) > kMaxBytes && !error)
    fail(file, "is larger than " + std::to_string(kMaxBytes) + " bytes, and no calibration");
  std::ifstream in;
  if (regular) in.open(file, std::ios::binary);
  if (!in.is_open()) fail(file, "cannot be read: is it there, and may you read it?");
  std::string text;
  // By read(), which knows a disk that fails from the end of the file.
  std::array<char, 1 << 14> part;
  while (in.good() && text.size() <= kMaxBytes) {
    in.read(part.data(), part.size());
    text.append(part.data(), static_cast<std::size_t>(in.gcount()));
  }
  if (in.bad()) fail(file, "cannot be read to its end: the disk may be damaged");
  return text;
}

void look_at_checksum(const std::filesystem::path& file, const toml::table& root, const std::string& text, CalibrationNotes* notes) {
  const toml::node* node = root.get("checksum");
  if (notes != nullptr) notes->checksum = node != nullptr ? node->value_or(std::string()) : std::string();
  if (node == nullptr) return;
  const auto line = "line " + std::to_string(node->source().begin.line) + ": ";
  switch (check_checksum(text)) {
    case ChecksumVerdict::right:
      return;
    case ChecksumVerdict::broken:
      fail(file, line + "checksum is not as this program writes it; who edits the file takes the line out");
    case ChecksumVerdict::wrong:
      fail(file, line +
                     "the checksum is that of other bytes: the file is damaged, or was edited. Put back the one before (boothctl calibrate --restore), or, "
                     "after an edit, take the line out");
  }
}

void check_version(const std::filesystem::path& file, const toml::table& root, CalibrationNotes* notes) {
  const toml::node* node = root.get("version");
  if (node == nullptr) return;
  const auto found = node->value_exact<std::int64_t>();
  const auto line = "line " + std::to_string(node->source().begin.line) + ": ";
  if (!found) fail(file, line + "version must be a whole number");
  const auto verdict = hal::judge_file_version(*found, kCalibrationVersion);
  if (verdict == hal::FileVersion::unreadable) fail(file, line + hal::file_version_complaint(*found, kCalibrationVersion));
  if (verdict == hal::FileVersion::newer && notes != nullptr)
    notes->newer.push_back(file.string() + ": " + hal::file_version_complaint(*found, kCalibrationVersion));
}

/// Only told, never computed with: what is not as this program writes it is as good as missing, and no reason to refuse the cameras.
void note_origin(const toml::table& root, CalibrationNotes& notes) {
  constexpr double kMost = 1e6;  // mm
  const auto& origin = root["calibration"];
  notes.utc = origin["utc"].value_or(std::string());
  const auto metres = [&](const char* key) {
    const double mm = origin["held_out"][key].value_or(-1.0);
    return mm >= 0 && mm < kMost ? mm / 1000 : -1;
  };
  notes.held_out_corner = metres("corner_mm");
  notes.held_out_corner_p95 = metres("corner_p95_mm");
  notes.held_out_plane = metres("plane_mm");
}

}  // namespace

toml::table parse_calibration(const std::filesystem::path& file, CalibrationNotes* notes) {
  const std::string text = read_whole(file);
  try {
    toml::table root = parse_toml(text, file.string());
    check_version(file, root, notes);
    look_at_checksum(file, root, text, notes);
    if (notes != nullptr) note_origin(root, *notes);
    return root;
  } catch (const toml::parse_error& e) {
    fail(file, "line " + std::to_string(e.source().begin.line) + ": " + std::string(e.description()));
  }
}

std::vector<CameraTable> camera_tables(const std::filesystem::path& file, const toml::table& root) {
  const auto* tables = root["camera"].as_array();
  if (tables == nullptr || tables->empty()) fail(file, "has no [[camera]] table");
  if (tables->size() > kMaxCameras) fail(file, "has " + std::to_string(tables->size()) + " cameras, allowed are " + std::to_string(kMaxCameras));
  std::vector<CameraTable> out;
  for (const auto& node : *tables) {
    const auto* table = node.as_table();
    if (table == nullptr) fail(file, "'camera' must be a table: write [[camera]]");
    out.emplace_back(file, *table, out.size());
  }
  return out;
}

namespace {

std::vector<hal::CameraDescription> descriptions(const std::filesystem::path& file, const toml::table& root) {
  std::vector<hal::CameraDescription> cameras;
  for (const CameraTable& table : camera_tables(file, root)) cameras.push_back(table.description());
  return cameras;
}

}  // namespace

std::vector<hal::CameraDescription> read_calibration(const std::filesystem::path& file, CalibrationNotes* notes) {
  return descriptions(file, parse_calibration(file, notes));
}

std::vector<double> read_time_offsets(const std::filesystem::path& file) {
  constexpr double kMost = 50;  // ms: more than a frame is no delay of a camera
  const toml::table root = parse_calibration(file);
  std::vector<double> out;
  for (const CameraTable& table : camera_tables(file, root)) {
    const double offset = table.number("time_offset_ms", 0);
    if (!(offset >= -kMost && offset <= kMost)) table.wrong("time_offset_ms", "must be from -50 to 50");
    out.push_back(offset / 1000);
  }
  return out;
}

std::vector<hal::CameraDescription> parse_calibration_text(const std::string& text, const std::filesystem::path& name) {
  try {
    const toml::table root = parse_toml(text, name.string());
    check_version(name, root, nullptr);
    look_at_checksum(name, root, text, nullptr);
    return descriptions(name, root);
  } catch (const toml::parse_error& e) {
    fail(name, "line " + std::to_string(e.source().begin.line) + ": " + std::string(e.description()));
  }
}

}  // namespace booth::drivers

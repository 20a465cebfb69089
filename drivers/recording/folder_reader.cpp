// calibration.toml and, for each camera, depth.txt with the 16-bit PNGs it names (TUM layout).
#include <algorithm>
#include <fstream>
#include <set>
#include <sstream>
#include <stdexcept>

#define TOML_ENABLE_FORMATTERS 0
#include <toml++/toml.h>

#include "drivers/recording/layouts.hpp"
#include "drivers/recording/png16.hpp"
#include "drivers/recording/text.hpp"

namespace booth::drivers {
namespace {

namespace fs = std::filesystem;
constexpr std::size_t kMaxFrames = 10'000'000, kMaxCameras = 64, kMaxBackground = 1000;

[[noreturn]] void fail(const fs::path& file, const std::string& what) { throw std::runtime_error(file.string() + ": " + what); }

/// A name inside the recording: nothing in it may lead out.
bool stays_inside(const fs::path& name) {
  return !name.empty() && name.is_relative() && std::none_of(name.begin(), name.end(), [](const fs::path& part) { return part == ".."; });
}

class FolderStore final : public FrameStore {
 public:
  FolderStore(std::vector<hal::UtcTime> times, std::vector<std::string> files, int width, int height)
      : times_(std::move(times)), files_(std::move(files)), reader_(width, height) {}
  const std::vector<hal::UtcTime>& times() const override { return times_; }
  Load load(std::size_t i, std::vector<std::uint16_t>& depth) noexcept override { return reader_.read(files_[i].c_str(), depth); }

 private:
  std::vector<hal::UtcTime> times_;
  std::vector<std::string> files_;
  PngReader reader_;
};

void read_index(const fs::path& folder, std::vector<hal::UtcTime>& times, std::vector<std::string>& files) {
  const fs::path path = folder / "depth.txt";
  std::ifstream in(path);
  if (!in) fail(path, "cannot be read; each camera's folder needs one line 'timestamp_seconds filename' for each frame");
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    const std::string place = "line " + std::to_string(number) + ": ";
    std::istringstream words(line);
    std::string stamp, name;
    if (!(words >> stamp) || stamp[0] == '#') continue;
    if (!(words >> name)) fail(path, place + "expected 'timestamp_seconds filename'");
    const auto time = parse_seconds(stamp);
    if (!time) fail(path, place + "the timestamp is no number of seconds");
    if (!times.empty() && *time <= times.back()) fail(path, place + "the timestamp is not after the one before");
    if (!stays_inside(name)) fail(path, place + "the file name leads out of the recording");
    if (times.size() >= kMaxFrames) fail(path, place + "more frames than " + std::to_string(kMaxFrames));
    times.push_back(*time);
    files.push_back((folder / name).string());
  }
}

/// Reads one [[camera]] table with errors that name the file, the line and the key.
class CameraTable {
 public:
  CameraTable(const fs::path& file, const toml::table& table, std::size_t index) : file_(file), table_(table), index_(index) {}

  [[noreturn]] void wrong(const char* key, const std::string& what) const {
    const toml::node* node = table_.get(key);
    const auto line = node != nullptr ? node->source().begin.line : table_.source().begin.line;
    fail(file_, "line " + std::to_string(line) + ": camera " + std::to_string(index_ + 1) + ", " + key + " " + what);
  }
  double number(const char* key) const {
    const auto value = table_[key].value<double>();
    if (!value) wrong(key, "must be a number");
    return *value;
  }
  double number(const char* key, double otherwise) const { return table_.contains(key) ? number(key) : otherwise; }
  int whole(const char* key) const {
    const auto value = table_[key].value<std::int64_t>();
    if (!value || *value < 0 || *value > 1'000'000) wrong(key, "must be a whole number from 0 to 1000000");
    return static_cast<int>(*value);
  }
  std::string text(const char* key, const std::string& otherwise) const {
    if (!table_.contains(key)) return otherwise;
    const auto value = table_[key].value<std::string>();
    if (!value) wrong(key, "must be text");
    return *value;
  }
  const toml::array& array(const char* key, std::size_t size) const {
    const auto* a = table_[key].as_array();
    if (a == nullptr || a->size() != size) wrong(key, "must be an array of " + std::to_string(size));
    return *a;
  }
  bool has(const char* key) const { return table_.contains(key); }
  const toml::table& table() const { return table_; }

 private:
  const fs::path& file_;
  const toml::table& table_;
  std::size_t index_;
};

RecordedCameraData read_camera(const fs::path& path, const fs::path& file, const CameraTable& t, std::size_t index) {
  RecordedCameraData data;
  auto& d = data.description;
  d.name = t.text("name", "camera-" + std::to_string(index));
  d.serial = t.text("serial", "");
  auto& k = d.intrinsics;
  k.width = t.whole("width");
  k.height = t.whole("height");
  k.fx = t.number("fx");
  k.fy = t.number("fy");
  k.cx = t.number("cx");
  k.cy = t.number("cy");
  d.depth_scale = t.number("depth_scale", 0.001);
  if (t.has("distortion")) {
    const auto& a = t.array("distortion", 5);
    for (std::size_t i = 0; i < 5; ++i) {
      const auto value = a[i].value<double>();
      if (!value) t.wrong("distortion", "must hold five numbers: k1 k2 p1 p2 k3");
      k.distortion[i] = *value;
    }
  }
  const auto& rows = t.array("camera_to_world", 4);
  for (std::size_t r = 0; r < 4; ++r) {
    const auto* row = rows[r].as_array();
    if (row == nullptr || row->size() != 4) t.wrong("camera_to_world", "must be four rows of four numbers");
    for (std::size_t c = 0; c < 4; ++c) {
      const auto value = (*row)[c].value<double>();
      if (!value) t.wrong("camera_to_world", "must be four rows of four numbers");
      if (r == 3 && *value != (c == 3 ? 1.0 : 0.0)) t.wrong("camera_to_world", "must end with the row 0 0 0 1");
      if (r < 3 && c < 3) d.camera_to_world.rotation[3 * r + c] = *value;
      if (r < 3 && c == 3) d.camera_to_world.translation[r] = *value;
    }
  }
  check_description(d, file.string());

  const std::string folder_name = t.text("folder", ".");
  if (!stays_inside(folder_name)) t.wrong("folder", "leads out of the recording");
  const fs::path folder = path / folder_name;
  std::vector<hal::UtcTime> times;
  std::vector<std::string> files;
  read_index(folder, times, files);
  d.nominal_rate = t.number("rate", rate_of(times));
  if (!(d.nominal_rate > 0 && d.nominal_rate <= 1000)) t.wrong("rate", "must be above 0 and at most 1000 frames per second");

  if (t.has("background")) {
    const auto* entries = t.table()["background"].as_array();
    if (entries == nullptr || entries->size() > kMaxBackground)
      t.wrong("background", "must be an array of frame numbers or file names, at most " + std::to_string(kMaxBackground));
    PngReader reader(k.width, k.height);
    for (const auto& entry : *entries) {
      std::string name;
      if (const auto number = entry.value<std::int64_t>()) {
        if (*number < 0 || *number >= static_cast<std::int64_t>(files.size()))
          t.wrong("background", "names frame " + std::to_string(*number) + ", the recording has " + std::to_string(files.size()));
        name = files[static_cast<std::size_t>(*number)];
      } else if (const auto text = entry.value<std::string>(); text && stays_inside(*text)) {
        name = (folder / *text).string();
      } else {
        t.wrong("background", "must hold frame numbers (from 0, in the order of depth.txt) or file names inside the folder");
      }
      auto& picture = data.background.emplace_back(static_cast<std::size_t>(k.width) * static_cast<std::size_t>(k.height));
      if (reader.read(name.c_str(), picture) != Load::ok)
        t.wrong("background", "names " + name + ", which is missing or not a 16-bit grey PNG of the camera's size");
    }
  }
  data.frames = std::make_unique<FolderStore>(std::move(times), std::move(files), k.width, k.height);
  return data;
}

}  // namespace

std::vector<RecordedCameraData> read_folder(const fs::path& path) {
  const fs::path file = path / "calibration.toml";
  toml::table root;
  try {
    root = toml::parse_file(file.string());
  } catch (const toml::parse_error& e) {
    fail(file, "line " + std::to_string(e.source().begin.line) + ": " + std::string(e.description()));
  }
  const auto* tables = root["camera"].as_array();
  if (tables == nullptr || tables->empty()) fail(file, "has no [[camera]] table");
  if (tables->size() > kMaxCameras) fail(file, "has " + std::to_string(tables->size()) + " cameras, allowed are " + std::to_string(kMaxCameras));
  std::vector<RecordedCameraData> cameras;
  for (const auto& node : *tables) {
    const auto* table = node.as_table();
    if (table == nullptr) fail(file, "'camera' must be a table: write [[camera]]");
    cameras.push_back(read_camera(path, file, CameraTable(file, *table, cameras.size()), cameras.size()));
  }
  return cameras;
}

}  // namespace booth::drivers

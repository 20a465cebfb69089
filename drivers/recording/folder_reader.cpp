// calibration.toml and, for each camera, depth.txt with the 16-bit PNGs it names (TUM layout).
#include <algorithm>
#include <fstream>
#include <set>
#include <sstream>
#include <stdexcept>

#include "drivers/recording/camera_table.hpp"
#include "drivers/recording/layouts.hpp"
#include "drivers/recording/png16.hpp"
#include "drivers/recording/text.hpp"

namespace booth::drivers {
namespace {

namespace fs = std::filesystem;
constexpr std::size_t kMaxFrames = 10'000'000, kMaxBackground = 1000;

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

RecordedCameraData read_camera(const fs::path& path, const CameraTable& t) {
  RecordedCameraData data;
  auto& d = data.description;
  d = t.description();
  const auto& k = d.intrinsics;

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
      if (data.background.size() >= most_background(k))
        t.wrong("background", "holds more pictures than fit into " + std::to_string(kMostBackgroundBytes >> 20) + " MiB");
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
  const toml::table root = parse_calibration(file);
  std::vector<RecordedCameraData> cameras;
  for (const CameraTable& table : camera_tables(file, root)) cameras.push_back(read_camera(path, table));
  return cameras;
}

}  // namespace booth::drivers

// Names and numbers of files; the pictures themselves are read by the drivers.
#include "daemon/calibrate/view_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "daemon/drivers_factory.calibration.hpp"
#include "daemon/io/atomic_file.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;
constexpr int kMostViews = 1000;

fs::path file_of(const fs::path& folder, int view, const char* kind) { return folder / fmt::format("view-{:03}.{}.png", view, kind); }

/// A name inside the folder: nothing in it may lead out.
bool stays_inside(const fs::path& name) {
  return !name.empty() && name.is_relative() && std::none_of(name.begin(), name.end(), [](const fs::path& part) { return part == ".."; });
}

int views_in(const fs::path& folder) {
  int views = 0;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    int number = -1;
    const std::string name = entry.path().filename().string();
    if (name.size() == 21 && name.starts_with("view-") && name.ends_with(".infrared.png") &&
        std::all_of(name.begin() + 5, name.begin() + 8, [](char c) { return c >= '0' && c <= '9'; }))
      number = std::stoi(name.substr(5, 3));
    views = std::max(views, number + 1);
  }
  return views;
}

ViewFolder with_folders(const fs::path& path, std::vector<hal::CameraDescription> cameras) {
  ViewFolder out{path, std::move(cameras), {}, 0};
  for (const auto& c : out.cameras) {
    if (!stays_inside(c.name)) throw std::runtime_error(fmt::format("{}: the camera's name '{}' cannot be that of a folder", path.string(), c.name));
    out.folders.push_back(path / c.name);
  }
  return out;
}

}  // namespace

ViewFolder open_view_folder(const fs::path& path) {
  ViewFolder out = with_folders(path, read_cameras(path / "calibration.toml"));
  for (const auto& folder : out.folders) out.views = std::max(out.views, views_in(folder));
  if (out.views == 0)
    throw std::runtime_error(
        fmt::format("{}: there are no views; expected are pictures like {}", path.string(), file_of(out.folders.front(), 0, "infrared").string()));
  return out;
}

std::vector<hal::DepthFrame> read_view(const ViewFolder& folder, int view) {
  std::vector<hal::DepthFrame> out;
  for (std::size_t c = 0; c < folder.cameras.size(); ++c) {
    const auto& k = folder.cameras[c].intrinsics;
    auto infrared = read_picture(file_of(folder.folders[c], view, "infrared"), k.width, k.height);
    if (!infrared) continue;
    hal::DepthFrame frame;
    frame.camera = static_cast<hal::CameraIndex>(c);
    frame.sequence = static_cast<std::uint64_t>(view);
    frame.infrared = std::move(*infrared);
    if (auto depth = read_picture(file_of(folder.folders[c], view, "depth"), k.width, k.height)) frame.depth = std::move(*depth);
    out.push_back(std::move(frame));
  }
  return out;
}

ViewFolder create_view_folder(const fs::path& path, const std::vector<hal::CameraDescription>& cameras) {
  std::error_code ignored;
  if (fs::exists(path, ignored) && !fs::is_empty(path, ignored)) throw std::runtime_error(fmt::format("{}: is not empty; name a new folder", path.string()));
  ViewFolder out = with_folders(path, cameras);
  for (const auto& folder : out.folders) fs::create_directories(folder);
  std::string text = "# Views of the calibration board; camera_to_world is where each camera should stand.\nversion = 1\n";
  for (const auto& c : cameras) text += camera_table(c);
  write_file_atomically(path / "calibration.toml", text);
  return out;
}

void write_view(ViewFolder& folder, const std::vector<hal::DepthFrame>& frames) {
  if (folder.views >= kMostViews) throw std::runtime_error(fmt::format("{}: holds {} views already", folder.path.string(), kMostViews));
  for (const auto& frame : frames) {
    const auto c = static_cast<std::size_t>(hal::to_int(frame.camera));
    if (c >= folder.cameras.size() || frame.infrared.empty()) continue;
    const auto& k = folder.cameras[c].intrinsics;
    write_picture(file_of(folder.folders[c], folder.views, "infrared"), k.width, k.height, frame.infrared);
    if (!frame.depth.empty()) write_picture(file_of(folder.folders[c], folder.views, "depth"), k.width, k.height, frame.depth);
  }
  ++folder.views;
}

}  // namespace booth::daemon

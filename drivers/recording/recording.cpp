// From a path to cameras and truth.
#include "drivers/recording/recording.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "drivers/recording/layouts.hpp"
#include "drivers/recording/recorded_camera.hpp"
#include "drivers/recording/sealed_recording.hpp"
#include "drivers/recording/truth_file.hpp"

namespace booth::drivers {

void check_description(hal::CameraDescription& camera, const std::string& place) {
  const auto require = [&](bool ok, const std::string& what) {
    if (!ok) throw std::runtime_error(place + ": camera '" + camera.name + "' " + what);
  };
  const auto& k = camera.intrinsics;
  require(k.width >= 8 && k.height >= 8 && k.width <= 8192 && k.height <= 4096,
          "has " + std::to_string(k.width) + " x " + std::to_string(k.height) + " pixels; allowed are 8 x 8 to 8192 x 4096");
  require(std::isfinite(k.fx) && std::isfinite(k.fy) && k.fx > 0 && k.fy > 0, "has a focal length (fx, fy) that is not above 0");
  require(std::isfinite(k.cx) && std::isfinite(k.cy), "has an image centre (cx, cy) that is no number");
  for (const double d : k.distortion) require(std::isfinite(d), "has a distortion that is no number");
  require(std::isfinite(camera.depth_scale) && camera.depth_scale > 0 && camera.depth_scale <= 1, "has a depth_scale outside 0 to 1 metre per count");
  constexpr double kMostGain = 0.2, kMostOffset = 0.5;
  require(std::abs(camera.depth_gain) <= kMostGain, "has a depth_gain outside -0.2 to 0.2");
  require(std::abs(camera.depth_offset) <= kMostOffset, "has a depth_offset outside -0.5 to 0.5 m");
  for (const double t : camera.camera_to_world.translation)
    require(std::isfinite(t) && std::abs(t) < 1000, "stands further than 1000 m away (camera_to_world)");

  auto& r = camera.camera_to_world.rotation;  // row-major
  for (const double x : r) require(std::isfinite(x), "has a rotation that is no number (camera_to_world)");
  const auto dot = [&](std::size_t a, std::size_t b) { return r[3 * a] * r[3 * b] + r[3 * a + 1] * r[3 * b + 1] + r[3 * a + 2] * r[3 * b + 2]; };
  const double determinant = r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) + r[2] * (r[3] * r[7] - r[4] * r[6]);
  require(determinant > 0.99 && determinant < 1.01 && std::abs(dot(0, 1)) < 0.01 && std::abs(dot(0, 2)) < 0.01 && std::abs(dot(1, 2)) < 0.01,
          "has a camera_to_world whose 3 x 3 part is no right-handed rotation");
  // What is as exact as doubles are stays as it is, bit for bit: a replay must see the very camera that the live fit saw.
  constexpr double kExact = 1e-13;
  const auto exact = [&](std::size_t a, std::size_t b) { return std::abs(dot(a, b) - (a == b ? 1 : 0)) < kExact; };
  if (exact(0, 0) && exact(1, 1) && exact(2, 2) && exact(0, 1) && exact(0, 2) && exact(1, 2)) return;
  // Text often keeps few digits: Gram-Schmidt makes the rows orthonormal again.
  const auto normalise = [&](std::size_t a) {
    const double length = std::sqrt(dot(a, a));
    for (std::size_t i = 0; i < 3; ++i) r[3 * a + i] /= length;
  };
  normalise(0);
  const double along = dot(0, 1);
  for (std::size_t i = 0; i < 3; ++i) r[3 + i] -= along * r[i];
  normalise(1);
  r[6] = r[1] * r[5] - r[2] * r[4];
  r[7] = r[2] * r[3] - r[0] * r[5];
  r[8] = r[0] * r[4] - r[1] * r[3];
}

const hal::CameraDescription& camera_of(const hal::DepthFrame& frame, const std::vector<hal::CameraDescription>& cameras) {
  const auto index = static_cast<std::size_t>(hal::to_int(frame.camera));
  if (index >= cameras.size())
    throw std::runtime_error("a frame of camera " + std::to_string(index) + " cannot be recorded: the recording has " + std::to_string(cameras.size()));
  const auto& k = cameras[index].intrinsics;
  if (frame.depth.size() != static_cast<std::size_t>(k.width) * static_cast<std::size_t>(k.height))
    throw std::runtime_error("a frame of camera '" + cameras[index].name + "' has " + std::to_string(frame.depth.size()) + " pixels, its calibration " +
                             std::to_string(k.width) + " x " + std::to_string(k.height));
  return cameras[index];
}

Source open_recording(const std::filesystem::path& path, Pace pace, std::shared_ptr<hal::Clock> clock, TruthSurface surface) {
  std::error_code error;
  if (!std::filesystem::is_directory(path, error))
    throw std::runtime_error("recording " + path.string() + " is not a folder that can be read; name a rosbag2 folder or one with calibration.toml");
  if (is_sealed_recording(path))
    throw std::runtime_error("recording " + path.string() + " is sealed; `boothctl decrypt " + path.string() +
                             " --key FILE` makes one of it that can be played, for whoever has the private key");
  const bool bag = std::filesystem::exists(path / "metadata.yaml", error), folder = std::filesystem::exists(path / "calibration.toml", error);
  if (!bag && !folder)
    throw std::runtime_error("recording " + path.string() + " has neither metadata.yaml (rosbag2) nor calibration.toml (folder of depth images)");

  LiveGroups live;
  auto cameras = bag ? read_rosbag2(path, &live) : read_folder(path);
  std::optional<hal::UtcTime> zero;
  double slowest = 1e9;
  for (const auto& c : cameras) {
    if (!c.frames->times().empty()) zero = std::min(zero.value_or(hal::UtcTime::max()), c.frames->times().front());
    slowest = std::min(slowest, c.description.nominal_rate);
  }
  if (!zero) throw std::runtime_error("recording " + path.string() + " holds no depth frames");

  const auto timeline = std::make_shared<Timeline>(pace, std::move(clock), static_cast<int>(cameras.size()), hal::from_seconds(2 / slowest));
  Source source;
  // Frames that are handed out count from the first one; what was captured live did from elsewhere.
  live.to_live = hal::Nanoseconds((*zero - Timeline::kFastOrigin.time_since_epoch()).time_since_epoch()) - live.to_live;
  source.live = std::move(live);
  if (std::filesystem::exists(path / "truth.csv", error)) {
    std::optional<TruthBody> body;
    if (std::filesystem::exists(path / "truth.ply", error)) body = read_truth_ply(path / "truth.ply");
    source.truth = std::make_shared<RecordedTruth>(read_truth_csv(path / "truth.csv"), std::move(body), std::move(surface), timeline, *zero);
  }
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    for (auto& picture : cameras[i].background) {
      auto& frame = source.background.emplace_back();
      frame.camera = static_cast<hal::CameraIndex>(i);
      frame.depth = std::move(picture);
    }
    source.cameras.push_back(std::make_unique<RecordedCamera>(std::move(cameras[i]), static_cast<int>(i), timeline, *zero));
  }
  return source;
}

std::unique_ptr<hal::DepthSink> create_recording(const std::filesystem::path& path, Layout layout, const std::vector<hal::CameraDescription>& cameras,
                                                 const std::optional<TruthBody>& body, const std::vector<hal::DepthFrame>& background, bool compressed) {
  if (cameras.empty()) throw std::runtime_error("recording " + path.string() + " cannot be made without a camera");
  auto checked = cameras;
  for (auto& c : checked) check_description(c, path.string());
  return layout == Layout::folder ? write_folder(path, checked, body, background) : write_rosbag2(path, checked, body, background, compressed);
}

}  // namespace booth::drivers

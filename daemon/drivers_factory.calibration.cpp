// The few lines between the calibration and the drivers.
#include "daemon/drivers_factory.calibration.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <Eigen/Geometry>
#include <memory>
#include <random>
#include <stdexcept>

#include "daemon/security/utc_time.hpp"
#include "drivers/clock/system_clock.hpp"
#include "drivers/pacing/punctual_camera.hpp"
#include "drivers/recording/calibration_checksum.hpp"
#include "drivers/recording/calibration_file.hpp"
#include "drivers/recording/png16.hpp"
#include "drivers/synthetic/board_source.hpp"
#include "drivers/synthetic/board_view.hpp"
#include "drivers/synthetic/board_walk.hpp"
#include "drivers/synthetic/scene.hpp"

namespace booth::daemon {

std::vector<hal::CameraDescription> read_cameras(const std::filesystem::path& file) { return drivers::read_calibration(file); }

std::vector<hal::CameraDescription> read_cameras(const std::string& text, const std::filesystem::path& name) {
  return drivers::parse_calibration_text(text, name);
}

std::vector<double> read_time_offsets(const std::filesystem::path& file) { return drivers::read_time_offsets(file); }

CalibrationUsed calibration_used(const std::filesystem::path& file, const drivers::CalibrationNotes& notes, bool written) {
  CalibrationUsed out{.source = CalibrationUsed::Source::file,
                      .file = file.string(),
                      .utc = notes.utc,
                      .checksum = notes.checksum,
                      .held_out_corner = notes.held_out_corner,
                      .held_out_corner_p95 = notes.held_out_corner_p95,
                      .held_out_plane = notes.held_out_plane};
  if (calibrated_utc_ns(out) == 0) {
    struct stat status {};
    out.utc = written && ::stat(file.c_str(), &status) == 0 ? utc_text(status.st_mtime) : "";
  }
  return out;
}

std::int64_t calibrated_utc_ns(const CalibrationUsed& calibration) {
  constexpr std::int64_t kNanoseconds = 1'000'000'000, kMost = 9'000'000'000;  // seconds: the year 2255; more nanoseconds have no room
  const auto seconds = utc_of(calibration.utc);
  return seconds && *seconds > 0 && *seconds < kMost ? *seconds * kNanoseconds : 0;
}

hal::DepthCameras punctual_cameras(hal::DepthCameras cameras, const std::vector<double>& late) {
  for (std::size_t c = 0; c < cameras.size(); ++c) cameras[c] = drivers::punctual(std::move(cameras[c]), hal::from_seconds(late.at(c)));
  return cameras;
}

std::string with_checksum(const std::string& text) { return drivers::with_checksum(text); }

std::string camera_table(const hal::CameraDescription& camera, const std::string& folder) { return drivers::camera_table_text(camera, folder); }

std::optional<std::vector<std::uint16_t>> read_picture(const std::filesystem::path& file, int width, int height) {
  std::vector<std::uint16_t> pixels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  switch (drivers::PngReader(width, height).read(file.c_str(), pixels)) {
    case drivers::Load::ok:
      return pixels;
    case drivers::Load::missing:
      return std::nullopt;
    case drivers::Load::broken:
      break;
  }
  throw std::runtime_error(fmt::format("{}: is no 16-bit grey PNG of {} x {} pixels", file.string(), width, height));
}

void write_picture(const std::filesystem::path& file, int width, int height, const std::vector<std::uint16_t>& pixels) {
  if (pixels.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) throw std::invalid_argument("a picture has not the size it says");
  drivers::write_png16(file, width, height, pixels.data());
}

namespace {

/// The corners of a square of this side, aimed as in the booth of 4 m.
std::vector<hal::CameraDescription> ring_of(double side) {
  if (!(side >= 2 && side <= 6)) throw std::invalid_argument("the side of a simulated booth must be 2 to 6 m");
  auto ring = drivers::camera_ring();
  for (auto& camera : ring) {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> rotation(camera.camera_to_world.rotation.data());
    Eigen::Map<Eigen::Vector3d> at(camera.camera_to_world.translation.data());
    if (side != 4) {
      at.head<2>() *= side / 4;
      const Eigen::Vector3d z = (Eigen::Vector3d(0, 0, 0.95) - at).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
      rotation << x, z.cross(x), z;
    }
  }
  return ring;
}

}  // namespace

SimulatedCameras simulated_cameras(std::uint64_t seed, double side) {
  const auto ring = ring_of(side);
  SimulatedCameras out{ring, ring};
  std::mt19937_64 random(seed);
  const auto any = [&random] { return static_cast<double>(random() >> 11) / 4503599627370496.0 - 1; };
  for (auto& camera : out.real) {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> rotation(camera.camera_to_world.rotation.data());
    Eigen::Map<Eigen::Vector3d> translation(camera.camera_to_world.translation.data());
    const Eigen::Vector3d turn = 0.04 * Eigen::Vector3d(any(), any(), any()), shift = 0.06 * Eigen::Vector3d(any(), any(), any());
    const Eigen::Matrix3d turned = fit::calibrate::rotation_by(turn) * rotation;
    rotation = turned;
    translation += shift;
  }
  return out;
}

namespace {

std::vector<drivers::BoardViewSettings> view_settings(const SimulatedViews& settings, std::size_t cameras) {
  std::vector<drivers::BoardViewSettings> out(cameras);
  for (std::size_t c = 0; c < cameras; ++c) {
    out[c].noise = drivers::NoiseModel::parse(settings.noise);
    out[c].seed = settings.seed;
    // Each sensor has its own error in depth.
    out[c].depth_offset = 0.004 * (static_cast<double>(c) - 1.5);
  }
  return out;
}

std::vector<fit::calibrate::Rigid> places(const SimulatedViews& settings) {
  if (settings.views < 1 || settings.views > 900) throw std::invalid_argument("simulated views must be 1 to 900");
  return drivers::board_places({.views = settings.views, .reach = settings.side / 8, .seed = settings.seed});
}

}  // namespace

std::function<std::vector<hal::DepthFrame>(int view)> simulated_views(const SimulatedViews& settings) {
  const SimulatedCameras cameras = simulated_cameras(settings.seed, settings.side);
  const auto how = view_settings(settings, cameras.real.size());
  const auto booth = std::make_shared<std::vector<drivers::BoardCamera>>();
  for (std::size_t c = 0; c < cameras.real.size(); ++c) booth->emplace_back(cameras.real[c], static_cast<int>(c), how[c]);
  drivers::ShownBoard shown;
  shown.board.square = settings.square;
  return [booth, shown, where = places(settings)](int view) {
    if (view < 0 || view >= static_cast<int>(where.size())) throw std::invalid_argument("there is no such simulated view");
    drivers::ShownBoard now = shown;
    now.booth_from_board = where[static_cast<std::size_t>(view)];
    std::vector<hal::DepthFrame> out;
    for (auto& camera : *booth) out.push_back(camera.look(now, static_cast<std::uint64_t>(view)));
    return out;
  };
}

SimulatedCalibration open_simulated_calibration(const SimulatedViews& settings, double rate) {
  const SimulatedCameras cameras = simulated_cameras(settings.seed, settings.side);
  const auto installer = std::make_shared<drivers::SimulatedInstaller>(fit::calibrate::Board{settings.square}, places(settings));
  SimulatedCalibration out;
  out.clock = std::make_shared<drivers::SystemClock>();
  out.cameras = drivers::make_board_cameras(cameras.real, cameras.planned, view_settings(settings, cameras.real.size()), rate, installer, out.clock);
  out.move_on = [installer] { installer->move_on(); };
  return out;
}

}  // namespace booth::daemon

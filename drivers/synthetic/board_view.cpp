// Rays into a box and onto a sheet; sixteen to a pixel where the sheet is.
#include "drivers/synthetic/board_view.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/synthetic/mix.hpp"
#include "drivers/synthetic/optics.hpp"

namespace booth::drivers {
namespace {

using fit::calibrate::Board;
using fit::calibrate::Rigid;

constexpr float kWhitePaper = 20000;                                                                    // brightness at a metre
constexpr double kWhite = 0.85, kToner = 0.12, kWall = 0.5, kFloor = 0.3, kArm = 0.55, kMargin = 0.35;  // albedos; the margin in squares
constexpr float kSaturated = 65535;

/// Two normal numbers of a key (Box-Muller).
std::pair<float, float> normals(std::uint64_t key) {
  const std::uint64_t bits = mix(key + 0x9e3779b97f4a7c15ull);
  const double a = (static_cast<double>(bits >> 32) + 1) / 4294967297.0, b = static_cast<double>(bits & 0xffffffffu) / 4294967296.0;
  const double radius = std::sqrt(-2 * std::log(a));
  return {static_cast<float>(radius * std::cos(2 * EIGEN_PI * b)), static_cast<float>(radius * std::sin(2 * EIGEN_PI * b))};
}

/// Albedo of the print at a place on the sheet (board frame, metres); negative beside the sheet.
double print_at(const ShownBoard& shown, double x, double y) {
  const bool other = shown.print == ShownBoard::Print::other;
  const int columns = other ? 9 : Board::kColumns, rows = other ? 6 : Board::kRows;
  const double square = other ? shown.board.width() / 9 : shown.board.square;
  if (shown.print == ShownBoard::Print::mirrored) x = -x;
  const double c = x / square + 0.5 * columns, r = 0.5 * rows - y / square;
  if (c < -kMargin || r < -kMargin || c > columns + kMargin || r > rows + kMargin) return -1;
  if (c < 0 || r < 0 || c >= columns || r >= rows) return kWhite;
  const int column = static_cast<int>(c), row = static_cast<int>(r);
  bool black = (row + column) % 2 == 0;
  const bool dots = shown.print == ShownBoard::Print::board || shown.print == ShownBoard::Print::mirrored;
  if (dots && Board::dotted(row, column) && std::hypot(c - column - 0.5, r - row - 0.5) < Board::kDotRadius) black = !black;
  return black ? kToner : kWhite;
}

float depth_sigma(const NoiseModel& noise, double z, double cosine, double albedo) {
  if (noise.kind == NoiseModel::Kind::none) return 0;
  if (noise.kind == NoiseModel::Kind::gaussian) return static_cast<float>(noise.sigma);
  return static_cast<float>((0.0015 + 0.00022 * z * z) / std::max(cosine, 0.2) * (albedo < 0.2 ? 2.5 : 1));
}

}  // namespace

BoardCamera::BoardCamera(const hal::CameraDescription& camera, int camera_index, const BoardViewSettings& settings)
    : camera_(camera), index_(camera_index), settings_(settings) {
  Rigid pose;
  pose.rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(camera.camera_to_world.rotation.data());
  pose.translation = Eigen::Map<const Eigen::Vector3d>(camera.camera_to_world.translation.data());
  camera_from_booth_ = pose.inverse();
  const int width = camera.intrinsics.width, height = camera.intrinsics.height;
  room_.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) room_[static_cast<std::size_t>(v * width + u)] = room_at(u, v);
}

BoardCamera::Surface BoardCamera::room_at(double u, double v) const {
  const Rigid to_booth = camera_from_booth_.inverse();
  const Eigen::Vector3d ray = undistorted_ray(camera_.intrinsics, u, v).homogeneous(), along = to_booth.rotation * ray, from = to_booth.translation;
  double z = 1e9, cosine = 0, albedo = kWall;
  if (along.z() < 0) z = -from.z() / along.z(), cosine = -along.z() / along.norm(), albedo = kFloor;
  for (int axis = 0; axis < 2; ++axis) {
    const double wall = (std::copysign(settings_.room_half_width, along[axis]) - from[axis]) / along[axis];
    if (wall > 0 && wall < z) z = wall, cosine = std::abs(along[axis]) / along.norm(), albedo = kWall;
  }
  // A little structure, so that the room is no blank sheet: boards of a floor, seams of a wall.
  const Eigen::Vector3d p = from + z * along;
  const double seam = std::abs(std::remainder(p.x() + 0.37 * p.z(), 0.6)) < 0.015 || std::abs(std::remainder(p.y() + p.z(), 0.8)) < 0.015 ? 0.6 : 1;
  return {static_cast<float>(z), static_cast<float>(kWhitePaper * albedo * seam * cosine / (z * z * ray.squaredNorm())),
          depth_sigma(settings_.noise, z, cosine, albedo)};
}

void BoardCamera::paint(const ShownBoard& shown) {
  constexpr int kSide = 4;
  const auto& k = camera_.intrinsics;
  const Rigid pose = camera_from_booth_ * shown.booth_from_board, to_board = pose.inverse();
  const Eigen::Vector3d normal = pose.rotation.col(2);
  if (normal.dot(pose.translation) >= 0) return;  // its back: as if nobody held it
  int x0 = k.width, x1 = -1, y0 = k.height, y1 = -1;
  for (int i = 0; i < 16; ++i) {
    const int column = i % 4, row = i / 4;
    const double x = (column / 1.5 - 1) * (0.5 * shown.board.width() + shown.board.square),
                 y = (row / 1.5 - 1) * (0.5 * shown.board.height() + shown.board.square);
    const Eigen::Vector3d p = pose * Eigen::Vector3d(x, y, 0);
    if (p.z() < 0.2) return;
    const Eigen::Vector2d d = distort(k, p.x() / p.z(), p.y() / p.z());
    const double u = k.fx * d.x() + k.cx, v = k.fy * d.y() + k.cy;
    x0 = std::min(x0, static_cast<int>(std::clamp(u, -1e4, 1e4)) - 2), x1 = std::max(x1, static_cast<int>(std::clamp(u, -1e4, 1e4)) + 2);
    y0 = std::min(y0, static_cast<int>(std::clamp(v, -1e4, 1e4)) - 2), y1 = std::max(y1, static_cast<int>(std::clamp(v, -1e4, 1e4)) + 2);
  }
  for (int v = std::max(y0, 0); v <= std::min(y1, k.height - 1); ++v)
    for (int u = std::max(x0, 0); u <= std::min(x1, k.width - 1); ++u) {
      Surface& s = picture_[static_cast<std::size_t>(v * k.width + u)];
      double brightness = 0;
      for (int i = 0; i < kSide * kSide; ++i) {
        const int column = i % kSide, row = i / kSide;
        const double du = (column + 0.5) / kSide - 0.5, dv = (row + 0.5) / kSide - 0.5;
        const Eigen::Vector3d ray = undistorted_ray(k, u + du, v + dv).homogeneous();
        const double z = normal.dot(pose.translation) / normal.dot(ray);
        const Eigen::Vector3d p = z * ray, on = to_board * p;
        double albedo = print_at(shown, on.x(), on.y());
        if (shown.hidden > 0 && on.x() > (0.5 - shown.hidden) * shown.board.width() && std::abs(on.y()) < shown.board.height()) albedo = albedo < 0 ? -1 : kArm;
        if (albedo < 0 || z > s.z + 1e-3) {
          brightness += s.brightness;
          continue;
        }
        const double cosine = -normal.dot(ray) / ray.norm(), distance2 = p.squaredNorm();
        // The lamp stands beside the lens: its image appears where the sheet is seen face on.
        const double shine = shown.glare * 4 * std::pow(std::max(cosine, 0.0), 600);
        brightness += kWhitePaper * (albedo * cosine + shine) / distance2;
      }
      const Eigen::Vector3d ray = undistorted_ray(k, u, v).homogeneous();
      const double z = normal.dot(pose.translation) / normal.dot(ray);
      const Eigen::Vector3d on = to_board * Eigen::Vector3d(z * ray);
      const double albedo = print_at(shown, on.x(), on.y());
      if (albedo >= 0 && z < s.z) {
        const double cosine = -normal.dot(ray) / ray.norm();
        // Dark surfaces read a little too far, as those cameras do.
        s.z = static_cast<float>(z + (albedo < 0.2 && settings_.noise.kind == NoiseModel::Kind::kinect2 ? 0.006 : 0));
        s.sigma = depth_sigma(settings_.noise, z, cosine, albedo);
      }
      s.brightness = static_cast<float>(brightness / (kSide * kSide));
    }
}

hal::DepthFrame BoardCamera::look(const std::optional<ShownBoard>& shown, std::uint64_t number) {
  picture_ = room_;
  if (shown) paint(*shown);
  const int width = camera_.intrinsics.width, height = camera_.intrinsics.height;
  hal::DepthFrame frame;
  frame.camera = static_cast<hal::CameraIndex>(index_);
  frame.sequence = number;
  frame.depth.resize(picture_.size());
  frame.infrared.resize(picture_.size());
  // The lens: a small Gaussian, along rows and then along columns.
  const int reach = settings_.blur > 0 ? static_cast<int>(std::ceil(3 * settings_.blur)) : 0;
  std::vector<float> kernel, along(picture_.size()), blurred(picture_.size());
  float sum = 0;
  for (int i = -reach; i <= reach; ++i)
    kernel.push_back(reach > 0 ? static_cast<float>(std::exp(-0.5 * i * i / (settings_.blur * settings_.blur))) : 1), sum += kernel.back();
  for (float& w : kernel) w /= sum;
  const auto pass = [&](auto value, int step, int count, int i, int at) {
    float out = 0;
    for (int j = -reach; j <= reach; ++j) out += kernel[static_cast<std::size_t>(j + reach)] * value(i + (std::clamp(at + j, 0, count - 1) - at) * step);
    return out;
  };
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      along[static_cast<std::size_t>(y * width + x)] =
          pass([&](int i) { return picture_[static_cast<std::size_t>(i)].brightness; }, 1, width, y * width + x, x);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      blurred[static_cast<std::size_t>(y * width + x)] = pass([&](int i) { return along[static_cast<std::size_t>(i)]; }, width, height, y * width + x, y);

  const std::uint64_t key = mix(mix(settings_.seed * 0x9e3779b97f4a7c15ull + static_cast<std::uint64_t>(index_)) + number);
  const bool noisy = settings_.noise.kind != NoiseModel::Kind::none;
  for (std::size_t i = 0; i < picture_.size(); ++i) {
    const auto [a, b] = normals(key + i * 0x2545f4914f6cdd1dull);
    const float sigma = noisy ? std::hypot(30.0f, 0.02f * blurred[i]) : 0;
    const float brightness = std::clamp(blurred[i] + sigma * a, 0.0f, kSaturated);
    frame.infrared[i] = static_cast<std::uint16_t>(brightness + 0.5f);
    const double z = (1 + settings_.depth_gain) * static_cast<double>(picture_[i].z + (noisy ? picture_[i].sigma * b : 0)) + settings_.depth_offset;
    // Too bright to measure, or too far.
    const bool measured = brightness < 0.5f * kSaturated && z > 0.5 && z < 8;
    frame.depth[i] = measured ? static_cast<std::uint16_t>(std::min(z / camera_.depth_scale + 0.5, 65535.0)) : std::uint16_t{0};
  }
  return frame;
}

}  // namespace booth::drivers

// RANSAC with a fixed sequence for the floor, a planar Procrustes fit for the layout.
#include "fit/calibrate/stage.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace booth::fit::calibrate {
namespace {

constexpr double kMostTilt = 35 * EIGEN_PI / 180, kBelowCameras = 0.3;

Plane through(std::span<const Eigen::Vector3d> points, const Eigen::Vector3d& up) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const auto& p : points) scatter += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
  Eigen::Vector3d normal = solver.eigenvectors().col(0);
  if (normal.dot(up) < 0) normal = -normal;
  return {normal, normal.dot(mean)};
}

/// A frame whose z is the floor's normal and whose x lies along `forward` as far as the floor allows.
Rigid frame_on(const Plane& floor, const Eigen::Vector3d& origin, const Eigen::Vector3d& forward) {
  const Eigen::Vector3d z = floor.normal, x = (forward - z * z.dot(forward)).normalized(), y = z.cross(x);
  Rigid out;
  out.rotation << x.transpose(), y.transpose(), z.transpose();
  const Eigen::Vector3d foot = origin - z * floor.above(origin);
  out.translation = -(out.rotation * foot);
  return out;
}

struct Turn {
  double angle;
  Eigen::Vector2d shift;
  double rms;
};

/// The turn and shift in the plane that bring `from` nearest to `to`.
Turn planar_fit(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to) {
  Eigen::Vector2d a = Eigen::Vector2d::Zero(), b = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) a += from[i].head<2>(), b += to[i].head<2>();
  a /= static_cast<double>(from.size()), b /= static_cast<double>(from.size());
  double sine = 0, cosine = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector2d p = from[i].head<2>() - a, q = to[i].head<2>() - b;
    cosine += p.dot(q), sine += p.x() * q.y() - p.y() * q.x();
  }
  Turn out{std::atan2(sine, cosine), {}, 0};
  const Eigen::Rotation2Dd turn(out.angle);
  out.shift = b - turn * a;
  for (std::size_t i = 0; i < from.size(); ++i) {
    out.rms += (turn * from[i].head<2>() + out.shift - to[i].head<2>()).squaredNorm() + std::pow(from[i].z() - to[i].z(), 2);
  }
  out.rms = std::sqrt(out.rms / static_cast<double>(from.size()));
  return out;
}

}  // namespace

std::optional<FloorFit> find_floor(std::span<const Eigen::Vector3d> points, const Eigen::Vector3d& up, std::span<const Eigen::Vector3d> cameras) {
  constexpr int kTries = 600;
  constexpr std::size_t kSample = 3000, kMinimum = 200;
  constexpr double kBand = 0.025, kBelow = 0.06;
  if (points.size() < kMinimum) return std::nullopt;
  std::uint64_t state = 0x9e3779b97f4a7c15ull;
  const auto any = [&] {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return static_cast<std::size_t>((state >> 33) % points.size());
  };
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kSample);
  const auto possible = [&](const Plane& p) {
    return p.normal.dot(up) >= std::cos(kMostTilt) && std::all_of(cameras.begin(), cameras.end(), [&](const auto& c) { return p.above(c) > kBelowCameras; });
  };
  Plane best;
  double best_score = 0;
  for (int i = 0; i < kTries; ++i) {
    const Eigen::Vector3d &a = points[any()], &b = points[any()], &c = points[any()];
    Eigen::Vector3d normal = (b - a).cross(c - a);
    if (normal.norm() < 1e-3) continue;
    normal.normalize();
    if (normal.dot(up) < 0) normal = -normal;
    const Plane plane{normal, normal.dot(a)};
    if (!possible(plane)) continue;
    double score = 0;
    for (std::size_t k = 0; k < points.size(); k += stride) {
      const double h = plane.above(points[k]);
      // Nothing lies below a floor.
      score += std::abs(h) < kBand ? 1 : (h < -kBelow ? -2 : 0);
    }
    if (score > best_score) best_score = score, best = plane;
  }
  if (best_score <= 0) return std::nullopt;
  FloorFit fit{best, 0, 0};
  for (const double band : {0.04, 0.03, 0.02, 0.02}) {
    std::vector<Eigen::Vector3d> on;
    for (const auto& p : points)
      if (std::abs(fit.plane.above(p)) < band) on.push_back(p);
    if (on.size() < std::max(kMinimum, points.size() / 20)) return std::nullopt;
    fit.plane = through(on, up);
    fit.points = static_cast<int>(on.size());
    fit.rms = 0;
    for (const auto& p : on) fit.rms += fit.plane.above(p) * fit.plane.above(p);
    fit.rms = std::sqrt(fit.rms / static_cast<double>(on.size()));
  }
  if (!possible(fit.plane)) return std::nullopt;
  return fit;
}

Rigid booth_from_board_on_floor(const Plane& floor, const Rigid& base_from_board) {
  return frame_on(floor, base_from_board.translation, base_from_board.rotation.col(0));
}

Rigid booth_from_layout(const Plane& floor, std::span<const Eigen::Vector3d> found, std::span<const Eigen::Vector3d> expected) {
  const Rigid level = level_on(floor);
  std::vector<Eigen::Vector3d> here;
  for (const auto& p : found) here.push_back(level * p);
  const Turn turn = planar_fit(here, expected);
  const Rigid to_booth{Eigen::AngleAxisd(turn.angle, Eigen::Vector3d::UnitZ()).toRotationMatrix(), {turn.shift.x(), turn.shift.y(), 0}};
  return to_booth * level;
}

std::vector<std::pair<int, int>> exchanged_cameras(std::span<const Eigen::Vector3d> found, std::span<const Eigen::Vector3d> expected, double most_turn) {
  constexpr double kFits = 0.5;
  std::vector<std::pair<int, int>> out;
  if (planar_fit(found, expected).rms < kFits) return out;
  std::vector<Eigen::Vector3d> here(found.begin(), found.end());
  for (std::size_t a = 0; a < here.size(); ++a)
    for (std::size_t b = a + 1; b < here.size(); ++b) {
      std::swap(here[a], here[b]);
      if (const Turn turn = planar_fit(here, expected); turn.rms < kFits && std::abs(turn.angle) <= most_turn)
        out.emplace_back(static_cast<int>(a), static_cast<int>(b));
      std::swap(here[a], here[b]);
    }
  return out;
}

Rigid level_on(const Plane& floor) {
  const Eigen::Vector3d aside = std::abs(floor.normal.x()) < 0.7 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  return frame_on(floor, floor.normal * floor.height, aside);
}

}  // namespace booth::fit::calibrate

// Cross-validation by views, and three measures of it.
#include "fit/calibrate/hold_out.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

namespace booth::fit::calibrate {
namespace {

/// A board's plane by a camera's corrected depth alone: 1/z = a . (x, y, 1).
std::optional<Eigen::Vector3d> plane_by_depth(const Sighting& s, const DepthCorrection& correction) {
  constexpr std::size_t kFewest = 12;
  if (s.depth.size() < kFewest) return std::nullopt;
  Eigen::Vector3d a = Eigen::Vector3d::Zero();
  double limit = std::numeric_limits<double>::infinity();
  for (int round = 0; round < 3; ++round) {
    Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    std::vector<double> off;
    for (const DepthSample& d : s.depth) {
      const Eigen::Vector3d ray(d.x, d.y, 1);
      const double z = correction.true_depth(d.z);
      if (!(z > 0.1)) continue;
      const double error = round == 0 ? 0 : std::abs(1 / z - a.dot(ray)) * z * z;  // metres
      off.push_back(error);
      if (error > limit) continue;
      h += z * z * ray * ray.transpose();
      g += z * ray;
    }
    if (off.size() < kFewest) return std::nullopt;
    a = h.ldlt().solve(g);
    if (!a.allFinite()) return std::nullopt;
    if (round > 0) std::nth_element(off.begin(), off.begin() + static_cast<std::ptrdiff_t>(off.size() / 2), off.end());
    limit = round == 0 ? 0.05 : std::max(0.005, 4 * off[off.size() / 2]);
  }
  return a;
}

/// All that errors are summed in; means are taken at the end.
struct Sums {
  struct Camera {
    double squares = 0, corner = 0, plane = 0;
    std::size_t corners = 0, distances = 0, planes = 0;
    int pictures = 0;
  };
  std::vector<Camera> camera;
  std::vector<double> distance;
  int views = 0;
};

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void judge_view(std::span<const Lens> lenses, const Board& board, const std::vector<const Sighting*>& view, const BundleSettings& settings,
                const BundleState& x, Sums& sums) {
  // The board is placed by corners alone, so that depth is compared with something else than itself.
  std::vector<Sighting> corners_only;
  for (const Sighting* s : view) corners_only.push_back({s->view, s->camera, s->corner, s->pixel, {}});
  std::vector<const Sighting*> seen;
  for (const Sighting& s : corners_only) seen.push_back(&s);
  Rigid best;
  double least = std::numeric_limits<double>::infinity();
  for (const Sighting* s : view) {
    const auto c = static_cast<std::size_t>(s->camera);
    const auto start = pose_of_board(lenses[c], board, *s);
    if (!start) continue;
    Rigid pose = x.camera[c].inverse() * start->camera_from_board;
    const double cost = place_board(lenses, board, seen, settings, x, pose);
    if (cost < least) least = cost, best = pose;
  }
  if (!std::isfinite(least)) return;
  ++sums.views;
  std::map<int, std::vector<std::pair<int, Eigen::Vector3d>>> places;  // corner: camera and point of the base
  for (const Sighting* s : view) {
    const auto c = static_cast<std::size_t>(s->camera);
    const Rigid pose = x.camera[c] * best;
    auto& sum = sums.camera[c];
    ++sum.pictures;
    const auto plane = plane_by_depth(*s, x.depth[c]);
    const Rigid to_base = x.camera[c].inverse();
    for (std::size_t i = 0; i < s->corner.size(); ++i) {
      const Eigen::Vector2d pixel = s->pixel.col(static_cast<Eigen::Index>(i));
      sum.squares += (lenses[c].project(pose * board.corner(s->corner[i])) - pixel).squaredNorm();
      ++sum.corners;
      if (!plane) continue;
      const Eigen::Vector3d ray = lenses[c].ray(pixel).homogeneous();
      places[s->corner[i]].emplace_back(s->camera, to_base * Eigen::Vector3d(ray / plane->dot(ray)));
    }
    std::vector<double> off;
    for (const DepthSample& d : s->depth)
      if (const double z = depth_of_plane(pose, d.x, d.y); std::isfinite(z)) off.push_back(x.depth[c].true_depth(d.z) - z);
    if (off.size() < 3) continue;
    sum.plane += std::pow(median(off), 2);
    ++sum.planes;
  }
  for (const auto& [id, points] : places)
    for (std::size_t a = 0; a < points.size(); ++a)
      for (std::size_t b = a + 1; b < points.size(); ++b) {
        const double d = (points[a].second - points[b].second).norm();
        sums.distance.push_back(d);
        for (const int camera : {points[a].first, points[b].first}) {
          auto& sum = sums.camera[static_cast<std::size_t>(camera)];
          sum.corner += d;
          ++sum.distances;
        }
      }
}

void judge(std::span<const Lens> lenses, const Board& board, std::span<const Sighting> sightings, const BundleSettings& settings, std::span<const char> counts,
           const BundleState& x, Sums& sums) {
  std::map<int, std::vector<const Sighting*>> views;
  for (std::size_t i = 0; i < sightings.size(); ++i)
    if (counts.empty() || counts[i]) views[sightings[i].view].push_back(&sightings[i]);
  for (const auto& [number, view] : views)
    if (view.size() >= 2) judge_view(lenses, board, view, settings, x, sums);
}

Errors means(Sums sums) {
  Errors out;
  out.views = sums.views;
  double squares = 0, planes = 0;
  std::size_t corners = 0, plane_count = 0;
  const auto root = [](double sum, std::size_t n) { return n > 0 ? std::sqrt(sum / static_cast<double>(n)) : 0; };
  for (const auto& c : sums.camera) {
    squares += c.squares, corners += c.corners, planes += c.plane, plane_count += c.planes, out.pictures += c.pictures;
    out.camera.push_back(
        {root(c.squares, c.corners), c.distances > 0 ? 1000 * c.corner / static_cast<double>(c.distances) : 0, 1000 * root(c.plane, c.planes), c.pictures});
  }
  out.reprojection_px = root(squares, corners);
  out.plane_mm = 1000 * root(planes, plane_count);
  if (!sums.distance.empty()) {
    double sum = 0;
    for (const double d : sums.distance) sum += d;
    out.corner_mm = 1000 * sum / static_cast<double>(sums.distance.size());
    const auto late = sums.distance.begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(sums.distance.size() - 1));
    std::nth_element(sums.distance.begin(), late, sums.distance.end());
    out.corner_p95_mm = 1000 * *late;
  }
  return out;
}

}  // namespace

Errors errors_on(std::span<const Lens> lenses, const Board& board, std::span<const Sighting> sightings, const BundleSettings& settings,
                 std::span<const char> counts, const BundleState& cameras) {
  Sums sums;
  sums.camera.resize(lenses.size());
  judge(lenses, board, sightings, settings, counts, cameras, sums);
  return means(std::move(sums));
}

Errors cross_validate(std::span<const Lens> lenses, const Board& board, std::span<const Sighting> sightings, const BundleSettings& settings,
                      std::span<const char> leave_out, const BundleState& solution, int folds) {
  const auto out_already = [&](std::size_t i) { return i < leave_out.size() && leave_out[i]; };
  std::map<int, int> cameras_of_view;
  for (std::size_t i = 0; i < sightings.size(); ++i)
    if (!out_already(i)) ++cameras_of_view[sightings[i].view];
  std::map<int, int> fold_of_view;
  int next = 0;
  for (const auto& [view, cameras] : cameras_of_view)
    if (cameras >= 2) fold_of_view[view] = next++ % folds;
  Sums sums;
  sums.camera.resize(lenses.size());
  for (int fold = 0; fold < std::min(folds, next); ++fold) {
    std::vector<char> without(sightings.size(), 0), held(sightings.size(), 0);
    std::vector<int> left(lenses.size(), 0);
    for (std::size_t i = 0; i < sightings.size(); ++i) {
      const auto found = fold_of_view.find(sightings[i].view);
      held[i] = !out_already(i) && found != fold_of_view.end() && found->second == fold;
      without[i] = out_already(i) || held[i];
      if (!without[i] && found != fold_of_view.end()) ++left[static_cast<std::size_t>(sightings[i].camera)];
    }
    if (std::any_of(left.begin(), left.end(), [](int n) { return n == 0; })) continue;
    BundleState x = solution;
    adjust(lenses, board, sightings, settings, without, x);
    judge(lenses, board, sightings, settings, held, x, sums);
  }
  return means(std::move(sums));
}

}  // namespace booth::fit::calibrate

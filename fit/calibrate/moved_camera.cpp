// The same adjustment with one camera more; few moments are tried first, then those beside the best.
#include "fit/calibrate/moved_camera.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace booth::fit::calibrate {
namespace {

constexpr int kFewestAround = 2;  // views that must lie on each side of the move
constexpr double kMetres = 0.005, kRadians = 0.2 * EIGEN_PI / 180;

struct Trial {
  double cost = 0;
  Rigid before, after;
};

Trial try_split(std::span<const Lens> lenses, const Board& board, std::span<const Sighting> sightings, BundleSettings settings, const BundleState& solution,
                int camera, int view) {
  std::vector<Lens> more(lenses.begin(), lenses.end());
  const auto c = static_cast<std::size_t>(camera);
  more.push_back(lenses[c]);
  std::vector<Sighting> relabelled(sightings.begin(), sightings.end());
  for (Sighting& s : relabelled)
    if (s.camera == camera && s.view >= view) s.camera = static_cast<int>(lenses.size());
  BundleState x = solution;
  x.camera.push_back(x.camera[c]);
  x.depth.push_back(x.depth[c]);
  settings.iterations = 30;
  const BundleReport report = adjust(more, board, relabelled, settings, {}, x);
  return {report.cost, x.camera[c], x.camera.back()};
}

}  // namespace

std::optional<MovedCamera> find_moved_camera(std::span<const Lens> lenses, const Board& board, std::span<const Sighting> sightings,
                                             const BundleSettings& settings, const BundleState& solution, const BundleReport& report) {
  constexpr std::size_t kCoarse = 5;
  std::optional<MovedCamera> best;
  double least = report.cost;
  for (int camera = 0; camera < static_cast<int>(lenses.size()); ++camera) {
    std::set<int> mine;
    for (const Sighting& s : sightings)
      if (s.camera == camera) mine.insert(s.view);
    const std::vector<int> views(mine.begin(), mine.end());
    if (views.size() < 2 * kFewestAround) continue;
    const std::size_t first = kFewestAround, last = views.size() - kFewestAround;  // positions that may begin the second part
    const auto at = [&](std::size_t i) {
      const Trial t = try_split(lenses, board, sightings, settings, solution, camera, views[i]);
      if (t.cost < least) {
        least = t.cost;
        // Where the camera stood, as a motion of the camera itself.
        const Rigid step = t.after * t.before.inverse();
        best = MovedCamera{camera, views[i], (t.after.inverse().translation - t.before.inverse().translation).norm(),
                           angle_between(step.rotation, Eigen::Matrix3d::Identity())};
      }
      return t.cost;
    };
    std::size_t centre = first;
    double here = at(first);
    const std::size_t stride = std::max<std::size_t>(1, (last - first + kCoarse - 1) / kCoarse);
    for (std::size_t i = first + stride; i <= last; i += stride)
      if (const double cost = at(i); cost < here) here = cost, centre = i;
    for (std::size_t i = centre > first + stride ? centre - stride + 1 : first; i < std::min(centre + stride, last + 1); ++i)
      if (i != centre) at(i);
  }
  // Against the noise that is left: eight more unknowns and the choice among some forty moments gain forty variances by chance once in ten thousand times.
  constexpr double kVariances = 80;
  double residuals = 0;
  for (const Sighting& s : sightings)
    residuals += 2 * static_cast<double>(s.corner.size()) + std::min<double>(static_cast<double>(s.depth.size()), settings.depth_samples);
  const double variance = std::max(1.0, least / std::max(residuals, 1.0));
  if (!best || report.cost - least < kVariances * variance || (best->metres < kMetres && best->radians < kRadians)) return std::nullopt;
  return best;
}

}  // namespace booth::fit::calibrate

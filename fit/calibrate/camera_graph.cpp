// Counts over pairs, and a maximum spanning tree of medoids.
#include "fit/calibrate/camera_graph.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace booth::fit::calibrate {
namespace {

/// One view seen by both cameras of a pair.
struct Shared {
  const BoardPose* first;
  const BoardPose* second;
};

std::vector<Shared> shared_views(int a, int b, std::span<const Sighting> sightings, std::span<const BoardPose> poses) {
  std::vector<Shared> out;
  for (std::size_t i = 0; i < sightings.size(); ++i)
    for (std::size_t j = 0; j < sightings.size(); ++j)
      if (sightings[i].camera == a && sightings[j].camera == b && sightings[i].view == sightings[j].view) out.push_back({&poses[i], &poses[j]});
  return out;
}

/// Metres, a radian counting as one metre: the distance at which cameras stand from the board, about.
double distance(const Rigid& a, const Rigid& b) { return (a.translation - b.translation).norm() + angle_between(a.rotation, b.rotation); }

/// The relative pose first_from_second that the views agree on best.
Rigid medoid(const std::vector<Shared>& views) {
  std::vector<Rigid> candidates;
  for (const Shared& v : views) candidates.push_back(v.first->camera_from_board * v.second->camera_from_board.inverse());
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    double sum = 0;
    // Capped, so that a view that is quite wrong counts like any other that disagrees.
    for (const Rigid& other : candidates) sum += std::min(distance(candidates[i], other), 0.3);
    if (sum < least) least = sum, best = i;
  }
  return candidates[best];
}

}  // namespace

std::vector<CameraPair> camera_pairs(int cameras, std::span<const Sighting> sightings, std::span<const BoardPose> poses) {
  std::vector<CameraPair> out;
  for (int a = 0; a < cameras; ++a)
    for (int b = a + 1; b < cameras; ++b) {
      const auto views = shared_views(a, b, sightings, poses);
      CameraPair pair{a, b, static_cast<int>(views.size())};
      if (!views.empty()) {
        Eigen::Vector3d mean = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
        for (const Shared& v : views) mean += v.first->camera_from_board.translation, normal += v.first->camera_from_board.rotation.col(2);
        mean /= static_cast<double>(views.size());
        normal.normalize();
        for (const Shared& v : views) {
          pair.spread += (v.first->camera_from_board.translation - mean).squaredNorm();
          const double cosine = std::clamp(normal.dot(v.first->camera_from_board.rotation.col(2)), -1.0, 1.0);
          pair.variety += std::acos(cosine) * std::acos(cosine);
        }
        pair.spread = std::sqrt(pair.spread / static_cast<double>(views.size()));
        pair.variety = std::sqrt(pair.variety / static_cast<double>(views.size()));
      }
      out.push_back(pair);
    }
  return out;
}

bool is_strong(const CameraPair& pair, const Needs& needs) { return pair.views >= needs.pair_views && pair.spread >= needs.pair_spread; }

Progress progress(int cameras, std::span<const CameraPair> pairs, int views, const Needs& needs, std::span<const std::pair<int, int>> neighbours) {
  Progress out;
  out.views = views;
  std::vector<int> group(static_cast<std::size_t>(cameras)), partners(static_cast<std::size_t>(cameras));
  for (int c = 0; c < cameras; ++c) group[static_cast<std::size_t>(c)] = c;
  for (const CameraPair& p : pairs) {
    if (!is_strong(p, needs)) continue;
    const auto a = static_cast<std::size_t>(p.first), b = static_cast<std::size_t>(p.second);
    ++partners[a], ++partners[b];
    const int from = group[b], to = group[a];
    std::replace(group.begin(), group.end(), from, to);
  }
  out.connected = std::all_of(group.begin(), group.end(), [&](int g) { return g == group.front(); });
  const int wanted = std::min(2, cameras - 1);
  const auto lacks = [&](int c) { return partners[static_cast<std::size_t>(c)] < wanted; };
  for (const CameraPair& p : pairs) {
    if (is_strong(p, needs)) continue;
    const bool joins = group[static_cast<std::size_t>(p.first)] != group[static_cast<std::size_t>(p.second)];
    if (joins || lacks(p.first) || lacks(p.second)) out.weak.push_back(p);
  }
  const auto urgency = [&](const CameraPair& p) {
    const bool likely = std::find(neighbours.begin(), neighbours.end(), std::pair(p.first, p.second)) != neighbours.end();
    const bool joins = group[static_cast<std::size_t>(p.first)] != group[static_cast<std::size_t>(p.second)];
    return (likely ? 100 : 0) + (joins ? 50 : 0) + 10 * (lacks(p.first) + lacks(p.second)) + std::min(p.views, 9);
  };
  std::stable_sort(out.weak.begin(), out.weak.end(), [&](const CameraPair& a, const CameraPair& b) { return urgency(a) > urgency(b); });
  bool hanging = false;
  for (int c = 0; c < cameras; ++c) hanging = hanging || lacks(c);
  out.enough = out.connected && !hanging && views >= needs.views;
  if (out.enough) out.weak.clear();
  return out;
}

Start start_poses(int cameras, int views, std::span<const Sighting> sightings, std::span<const BoardPose> poses) {
  Start start{std::vector<std::optional<Rigid>>(static_cast<std::size_t>(cameras)), std::vector<std::optional<Rigid>>(static_cast<std::size_t>(views))};
  start.camera[0] = Rigid{};
  for (;;) {
    // Prim's algorithm: the link with most views from what is known to what is not.
    std::vector<Shared> best;
    std::size_t from = 0, to = 0;
    for (int a = 0; a < cameras; ++a)
      for (int b = 0; b < cameras; ++b) {
        if (!start.camera[static_cast<std::size_t>(a)] || start.camera[static_cast<std::size_t>(b)]) continue;
        auto now = shared_views(b, a, sightings, poses);
        if (now.size() > best.size()) best = std::move(now), from = static_cast<std::size_t>(a), to = static_cast<std::size_t>(b);
      }
    if (best.empty()) break;
    start.camera[to] = medoid(best) * *start.camera[from];
  }
  std::vector<double> quality(static_cast<std::size_t>(views), std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    const auto v = static_cast<std::size_t>(sightings[i].view), c = static_cast<std::size_t>(sightings[i].camera);
    // The nearest camera knows the board's place best.
    const double z = poses[i].camera_from_board.translation.z();
    if (start.camera[c] && z < quality[v]) quality[v] = z, start.board[v] = start.camera[c]->inverse() * poses[i].camera_from_board;
  }
  return start;
}

}  // namespace booth::fit::calibrate

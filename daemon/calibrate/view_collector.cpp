// Detection picture by picture, and the graph of who saw what together.
#include "daemon/calibrate/view_collector.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <stdexcept>

namespace booth::daemon {

using namespace fit::calibrate;

Rigid rigid_of(const hal::RigidTransform& t) {
  Rigid out;
  out.rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(t.rotation.data());
  out.translation = Eigen::Map<const Eigen::Vector3d>(t.translation.data());
  return out;
}

hal::RigidTransform transform_of(const Rigid& r) {
  hal::RigidTransform out;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.rotation.data()) = r.rotation;
  Eigen::Map<Eigen::Vector3d>(out.translation.data()) = r.translation;
  return out;
}

Lens lens_of(const hal::Intrinsics& k) { return {k.width, k.height, k.fx, k.fy, k.cx, k.cy, k.distortion}; }

ViewCollector::ViewCollector(std::vector<hal::CameraDescription> cameras, const Board& board, bool expected_known, const Needs& needs)
    : cameras_(std::move(cameras)) {
  input_.board = board;
  input_.needs = needs;
  for (const auto& c : cameras_) {
    input_.names.push_back(c.name);
    input_.lenses.push_back(lens_of(c.intrinsics));
    if (expected_known) input_.expected.push_back(rigid_of(c.camera_to_world));
  }
  input_.room.resize(cameras_.size());
}

FoundBoards ViewCollector::find(const std::vector<ViewPicture>& pictures) const {
  FoundBoards out;
  for (const ViewPicture& p : pictures) {
    if (p.camera < 0 || p.camera >= static_cast<int>(cameras_.size())) throw std::invalid_argument(fmt::format("there is no camera {}", p.camera));
    const auto c = static_cast<std::size_t>(p.camera);
    const Lens& lens = input_.lenses[c];
    if (p.infrared.width != lens.width || p.infrared.height != lens.height)
      throw std::invalid_argument(
          fmt::format("{}: a picture has {} x {} pixels, the camera {} x {}", cameras_[c].name, p.infrared.width, p.infrared.height, lens.width, lens.height));
    BoardDetection found = detect_board(p.infrared);
    out.mirrored += found.kind == BoardDetection::Kind::mirrored;
    out.foreign += found.kind == BoardDetection::Kind::foreign;
    if (found.kind != BoardDetection::Kind::board) continue;
    found.sighting.camera = p.camera;
    if (!p.depth.pixels.empty()) add_board_depth(p.depth, cameras_[c].depth_scale, lens, input_.board, found.sighting);
    if (const auto pose = pose_of_board(lens, input_.board, found.sighting)) out.boards.push_back({std::move(found.sighting), *pose});
  }
  return out;
}

ViewReport ViewCollector::add(const std::vector<ViewPicture>& pictures, FoundBoards found) {
  // The floor is the same in every view: a few are enough, and people stand elsewhere in each.
  constexpr int kRoomViews = 6, kRoomSamples = 2500;
  ViewReport report;
  const int view = input_.views++;
  if (view < kRoomViews)
    for (const ViewPicture& p : pictures) {
      if (p.depth.pixels.empty()) continue;
      const auto c = static_cast<std::size_t>(p.camera);
      const auto room = room_depth(p.depth, cameras_[c].depth_scale, input_.lenses[c], kRoomSamples);
      input_.room[c].insert(input_.room[c].end(), room.begin(), room.end());
    }
  for (auto& board : found.boards) {
    board.sighting.view = view;
    report.seen.push_back(board.sighting.camera);
    poses_.push_back(board.pose);
    input_.sightings.push_back(std::move(board.sighting));
  }
  report.mirrored = found.mirrored, report.foreign = found.foreign;
  input_.mirrored_pictures += report.mirrored;
  input_.foreign_pictures += report.foreign;
  std::multiset<int> views;
  for (const Sighting& s : input_.sightings) views.insert(s.view);
  int common = 0;
  for (int v = 0; v < input_.views; ++v) common += views.count(v) >= 2;
  const int cameras = static_cast<int>(cameras_.size());
  const auto near = neighbours();
  progress_ = progress(cameras, camera_pairs(cameras, input_.sightings, poses_), common, input_.needs, near);
  report.progress = progress_;
  return report;
}

/// For each camera the two nearest by plan.
std::vector<std::pair<int, int>> ViewCollector::neighbours() const {
  std::vector<std::pair<int, int>> out;
  for (std::size_t a = 0; a < input_.expected.size(); ++a) {
    std::vector<std::pair<double, int>> by_distance;
    for (std::size_t b = 0; b < input_.expected.size(); ++b)
      if (a != b) by_distance.emplace_back((input_.expected[a].translation - input_.expected[b].translation).norm(), static_cast<int>(b));
    std::sort(by_distance.begin(), by_distance.end());
    for (std::size_t i = 0; i < std::min<std::size_t>(2, by_distance.size()); ++i)
      out.emplace_back(std::min(static_cast<int>(a), by_distance[i].second), std::max(static_cast<int>(a), by_distance[i].second));
  }
  return out;
}

std::string ViewCollector::next_place() const {
  if (progress_.enough) return {};
  const auto name = [&](int c) { return cameras_[static_cast<std::size_t>(c)].name; };
  if (input_.views == 0 || progress_.weak.empty())
    return fmt::format("hold the board where two cameras see its print ({} of {} views)", progress_.views, input_.needs.views);
  const CameraPair& w = progress_.weak.front();
  return fmt::format("hold the board between {} and {}, its print towards both ({} of {} views there{})", name(w.first), name(w.second), w.views,
                     input_.needs.pair_views, w.views >= input_.needs.pair_views ? ", further apart" : "");
}

}  // namespace booth::daemon

// Detection picture by picture, and the graph of who saw what together.
#include "daemon/calibrate/view_collector.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <future>
#include <limits>
#include <stdexcept>

#include "daemon/calibrate/floor_board.hpp"
#include "fit/calibrate/arrangement.hpp"

namespace booth::daemon {

using namespace fit::calibrate;

namespace {
constexpr double kAnyRms = std::numeric_limits<double>::infinity();
}

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
  for (const ViewPicture& p : pictures) {
    if (p.camera < 0 || p.camera >= static_cast<int>(cameras_.size())) throw std::invalid_argument(fmt::format("there is no camera {}", p.camera));
    const auto c = static_cast<std::size_t>(p.camera);
    const Lens& lens = input_.lenses[c];
    if (p.infrared.width != lens.width || p.infrared.height != lens.height)
      throw std::invalid_argument(
          fmt::format("{}: a picture has {} x {} pixels, the camera {} x {}", cameras_[c].name, p.infrared.width, p.infrared.height, lens.width, lens.height));
  }
  std::vector<std::future<BoardDetection>> looks;
  for (const ViewPicture& p : pictures) looks.push_back(std::async(std::launch::async, [&p] { return detect_board(p.infrared); }));
  FoundBoards out;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    BoardDetection found = looks[i].get();
    out.mirrored += found.kind == BoardDetection::Kind::mirrored;
    out.foreign += found.kind == BoardDetection::Kind::foreign;
    if (found.kind == BoardDetection::Kind::board) take(pictures[i], std::move(found.sighting), kAnyRms, out);
  }
  return out;
}

/// A sighting with its depth and pose; not taken when it has none or fits it worse than `most_rms` pixels.
void ViewCollector::take(const ViewPicture& picture, Sighting sighting, double most_rms, FoundBoards& out) const {
  const auto c = static_cast<std::size_t>(picture.camera);
  sighting.camera = picture.camera;
  if (!picture.depth.pixels.empty()) add_board_depth(picture.depth, cameras_[c].depth_scale, input_.lenses[c], input_.board, sighting);
  if (const auto pose = pose_of_board(input_.lenses[c], input_.board, sighting); pose && pose->rms_px <= most_rms)
    out.boards.push_back({std::move(sighting), *pose});
}

const std::optional<std::vector<Rigid>>& ViewCollector::places() const {
  if (placed_from_ != input_.sightings.size()) {
    places_ = rough_places(input_);
    placed_from_ = input_.sightings.size();
  }
  return places_;
}

FoundBoards ViewCollector::find_on_floor(const std::vector<ViewPicture>& pictures, FoundBoards found) const {
  // Squares are six pixels high here: a shoe beside the board or a seam of the floor is easily taken for a corner.
  constexpr double kLikeness = 0.5, kMostRms = 0.6, kStray = 1.0;
  constexpr std::size_t kLeastCorners = 12;
  const auto& where = places();
  if (!where) return found;
  std::vector<FloorPicture> floor;
  for (const ViewPicture& p : pictures) {
    const auto c = static_cast<std::size_t>(p.camera);
    floor.push_back({p.infrared, input_.lenses[c], (*where)[c].inverse()});
  }
  const auto board = find_board_on_floor(floor, input_.board);
  if (!board) return found;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const auto seen = [&](const FoundBoards::Board& b) { return b.sighting.camera == pictures[i].camera; };
    if (board->likeness[i] < kLikeness || std::any_of(found.boards.begin(), found.boards.end(), seen)) continue;
    const Rigid pose = floor[i].camera_from_floor * board->floor_from_board;
    Eigen::Matrix2Xd corners(2, Board::kCorners);
    for (int id = 0; id < Board::kCorners; ++id) corners.col(id) = floor[i].lens.project(pose * input_.board.corner(id));
    auto sighting = sight_board_at(pictures[i].infrared, corners);
    if (!sighting) continue;
    drop_strays(input_.lenses[static_cast<std::size_t>(pictures[i].camera)], input_.board, kStray, kLeastCorners, *sighting);
    take(pictures[i], std::move(*sighting), kMostRms, found);
  }
  return found;
}

int ViewCollector::seen_in(int view) const {
  return static_cast<int>(std::count_if(input_.sightings.begin(), input_.sightings.end(), [&](const Sighting& s) { return s.view == view; }));
}

bool ViewCollector::saw(int view, int camera) const {
  return std::any_of(input_.sightings.begin(), input_.sightings.end(), [&](const Sighting& s) { return s.view == view && s.camera == camera; });
}

void ViewCollector::keep(int view, FoundBoards& found) {
  for (auto& board : found.boards) {
    board.sighting.view = view;
    poses_.push_back(board.pose);
    input_.sightings.push_back(std::move(board.sighting));
  }
  update_progress();
}

void ViewCollector::update_progress() {
  int common = 0;
  for (int v = 0; v < input_.views; ++v) common += seen_in(v) >= 2;
  const int cameras = static_cast<int>(cameras_.size());
  progress_ = progress(cameras, camera_pairs(cameras, input_.sightings, poses_), common, input_.needs, neighbours());
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
  for (const auto& board : found.boards) report.seen.push_back(board.sighting.camera);
  report.mirrored = found.mirrored, report.foreign = found.foreign;
  input_.mirrored_pictures += report.mirrored;
  input_.foreign_pictures += report.foreign;
  keep(view, found);
  report.progress = progress_;
  return report;
}

void ViewCollector::add_to_view(int view, FoundBoards found) {
  if (view < 0 || view >= input_.views) throw std::invalid_argument(fmt::format("there is no view {}", view));
  keep(view, found);
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

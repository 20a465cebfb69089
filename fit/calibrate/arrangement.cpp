// The first half of a calibration without its questions.
#include "fit/calibrate/arrangement.hpp"

#include <algorithm>

namespace booth::fit::calibrate {

Usable usable(const CalibrationInput& in) {
  Usable out;
  for (const Sighting& s : in.sightings)
    if (const auto pose = pose_of_board(in.lenses[static_cast<std::size_t>(s.camera)], in.board, s)) {
      out.sightings.push_back(s);
      out.poses.push_back(*pose);
    }
  return out;
}

std::vector<Eigen::Vector3d> room_points(const CalibrationInput& in, const BundleState& x) {
  std::vector<Eigen::Vector3d> out;
  for (std::size_t c = 0; c < in.room.size(); ++c) {
    const Rigid to_base = x.camera[c].inverse();
    for (const DepthSample& d : in.room[c]) out.push_back(to_base * Eigen::Vector3d(Eigen::Vector3d(d.x, d.y, 1) * x.depth[c].true_depth(d.z)));
  }
  return out;
}

std::vector<Eigen::Vector3d> centres(const BundleState& x) {
  std::vector<Eigen::Vector3d> out;
  for (const Rigid& c : x.camera) out.push_back(c.inverse().translation);
  return out;
}

Eigen::Vector3d rough_up(const BundleState& x) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const Rigid& c : x.camera) up -= c.rotation.transpose().col(1);
  return up.normalized();
}

std::optional<std::vector<Rigid>> rough_places(const CalibrationInput& in) {
  const int cameras = static_cast<int>(in.lenses.size());
  if (in.expected.size() != in.lenses.size() || cameras < 2) return std::nullopt;
  const Usable use = usable(in);
  const Start start = start_poses(cameras, in.views, use.sightings, use.poses);
  if (std::any_of(start.camera.begin(), start.camera.end(), [](const auto& c) { return !c.has_value(); })) return std::nullopt;
  BundleState x = state_of(start);
  adjust(in.lenses, in.board, use.sightings, in.bundle, {}, x);
  const auto stand = centres(x);
  const auto floor = find_floor(room_points(in, x), rough_up(x), stand);
  if (!floor) return std::nullopt;
  std::vector<Eigen::Vector3d> expected;
  for (const Rigid& e : in.expected) expected.push_back(e.translation);
  const Rigid to_booth = booth_from_layout(floor->plane, stand, expected);
  std::vector<Rigid> out;
  for (const Rigid& c : x.camera) out.push_back(to_booth * c.inverse());
  return out;
}

}  // namespace booth::fit::calibrate

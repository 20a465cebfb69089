// The questions in their order: was there a board, are there views enough, do they agree, where is the floor, how wrong is it; each refuses in its turn.
#include "fit/calibrate/calibration.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>

#include "fit/calibrate/arrangement.hpp"
#include "fit/calibrate/moved_camera.hpp"

namespace booth::fit::calibrate {
namespace {

constexpr double kDegree = EIGEN_PI / 180;
constexpr int kFolds = 4;

template <typename... Args>
std::string text(const char* format, Args... args) {
  char line[512];
  std::snprintf(line, sizeof line, format, args...);
  return line;
}

double median(std::vector<double> v) {
  const auto middle = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
  std::nth_element(v.begin(), middle, v.end());
  return *middle;
}

void check(const CalibrationInput& in) {
  const std::size_t n = in.lenses.size();
  if (n == 0 || in.names.size() != n) throw std::invalid_argument("a calibration needs as many names as lenses, and at least one");
  if (!in.expected.empty() && in.expected.size() != n) throw std::invalid_argument("a layout must have one place for each camera");
  if (!in.room.empty() && in.room.size() != n) throw std::invalid_argument("depth of the room must come from each camera");
  for (const Sighting& s : in.sightings) {
    if (s.camera < 0 || s.camera >= static_cast<int>(n) || s.view < 0 || s.view >= in.views)
      throw std::invalid_argument("a sighting names a camera or a view that does not exist");
    if (s.pixel.cols() != static_cast<Eigen::Index>(s.corner.size())) throw std::invalid_argument("a sighting has not as many pixels as corners");
    for (const int id : s.corner)
      if (id < 0 || id >= Board::kCorners) throw std::invalid_argument("a sighting names a corner that the board has not");
  }
}

/// The squares' size by depth against the size that was said: 0 where depth says nothing. The middle of the cameras' own medians.
double square_ratio(const CalibrationInput& in, const Usable& use) {
  std::vector<double> cameras;
  for (std::size_t c = 0; c < in.lenses.size(); ++c) {
    std::vector<double> ratios;
    for (std::size_t i = 0; i < use.sightings.size(); ++i) {
      if (use.sightings[i].camera != static_cast<int>(c)) continue;
      for (const DepthSample& d : use.sightings[i].depth)
        if (const double z = depth_of_plane(use.poses[i].camera_from_board, d.x, d.y); std::isfinite(z)) ratios.push_back(d.z / z);
    }
    if (ratios.size() >= 30) cameras.push_back(median(std::move(ratios)));
  }
  return cameras.empty() ? 0 : median(std::move(cameras));
}

int views_of_two(const std::vector<Sighting>& sightings, int views) {
  std::vector<int> count(static_cast<std::size_t>(views));
  for (const Sighting& s : sightings) ++count[static_cast<std::size_t>(s.view)];
  return static_cast<int>(std::count_if(count.begin(), count.end(), [](int n) { return n >= 2; }));
}

std::string names_of(const CalibrationInput& in, const CameraPair& p) {
  return in.names[static_cast<std::size_t>(p.first)] + " and " + in.names[static_cast<std::size_t>(p.second)];
}

Calibration refused(Calibration c, Refusal why, std::string sentence) {
  c.refusal = why;
  c.sentence = std::move(sentence);
  return c;
}

Calibration without_board(const CalibrationInput& in, Calibration out) {
  if (in.mirrored_pictures > 0)
    return refused(std::move(out), Refusal::mirrored_print,
                   text("the board is printed mirrored (seen so in %d pictures): print it again without 'mirror' or 'flip', dots and arrow as on the sheet",
                        in.mirrored_pictures));
  if (in.foreign_pictures > 0)
    return refused(std::move(out), Refusal::foreign_board,
                   text("another board was shown (a chessboard without our dots in %d pictures): print ours with `boothctl calibrate --print board.pdf`",
                        in.foreign_pictures));
  return refused(std::move(out), Refusal::no_board,
                 "no camera saw the board: hold it still, in full view, its print towards the cameras and nearer than 3.5 m");
}

std::string too_few(const CalibrationInput& in, const Progress& p) {
  std::string out = text("too few views: %d that two cameras or more saw, needed are %d", p.views, in.needs.views);
  if (!p.weak.empty()) {
    const CameraPair& w = p.weak.front();
    out += text("; weakest are %s with %d common views (needed: %d, at different places): hold the board between them", names_of(in, w).c_str(), w.views,
                in.needs.pair_views);
  }
  return out;
}

/// The board of the last view that lies flat on the floor, print upwards.
std::optional<Rigid> board_on_floor(const Plane& floor, const BundleState& x, const std::vector<Sighting>& sightings, const std::vector<char>& out) {
  constexpr double kFlat = 4 * kDegree, kHigh = 0.04;
  std::optional<Rigid> found;
  int last = -1;
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    if (out[i] || sightings[i].view <= last) continue;
    const Rigid& b = x.board[static_cast<std::size_t>(sightings[i].view)];
    if (b.rotation.col(2).dot(floor.normal) > std::cos(kFlat) && std::abs(floor.above(b.translation)) < kHigh) found = b, last = sightings[i].view;
  }
  return found;
}

std::string beyond(const Errors& e, const Limits& limits, const std::vector<std::string>& names) {
  const auto worst = [&](auto value) {
    std::size_t at = 0;
    for (std::size_t c = 1; c < e.camera.size(); ++c)
      if (value(e.camera[c]) > value(e.camera[at])) at = c;
    return names[at];
  };
  if (e.views == 0) return "no view was left to measure the error on";
  if (e.reprojection_px > limits.reprojection_px)
    return text("corners are %.2f px off (limit %.2f), worst in %s", e.reprojection_px, limits.reprojection_px,
                worst([](const auto& c) { return c.reprojection_px; }).c_str());
  if (e.corner_mm > limits.corner_mm)
    return text("two cameras see the same corner %.1f mm apart (limit %.1f), worst with %s", e.corner_mm, limits.corner_mm,
                worst([](const auto& c) { return c.corner_mm; }).c_str());
  if (e.plane_mm > limits.plane_mm)
    return text("measured depth is %.1f mm off the board (limit %.1f), worst in %s", e.plane_mm, limits.plane_mm,
                worst([](const auto& c) { return c.plane_mm; }).c_str());
  return {};
}

/// Pictures that disagree with everything else: misread boards, boards in motion. Of two pictures of one view nobody can say which is wrong: both go.
int leave_out_wrong(const std::vector<Sighting>& sightings, const BundleReport& report, const Limits& limits, std::vector<char>& out) {
  std::vector<double> rms;
  for (std::size_t i = 0; i < report.rms_px.size(); ++i)
    if (!out[i]) rms.push_back(report.rms_px[i]);
  if (rms.empty()) return 0;
  const double limit = std::max(limits.reprojection_px, 4 * median(std::move(rms)));
  const auto before = std::count(out.begin(), out.end(), 1);
  for (std::size_t i = 0; i < report.rms_px.size(); ++i) {
    if (out[i] || report.rms_px[i] <= limit) continue;
    const auto in_view = [&](std::size_t k) { return sightings[k].view == sightings[i].view; };
    std::size_t pictures = 0;
    for (std::size_t k = 0; k < sightings.size(); ++k) pictures += in_view(k);
    for (std::size_t k = 0; k < sightings.size(); ++k)
      if (k == i || (in_view(k) && pictures <= 2)) out[k] = 1;
  }
  return static_cast<int>(std::count(out.begin(), out.end(), 1) - before);
}

}  // namespace

const char* to_string(Refusal r) {
  switch (r) {
    case Refusal::none:
      return "none";
    case Refusal::no_board:
      return "no-board";
    case Refusal::mirrored_print:
      return "mirrored-print";
    case Refusal::foreign_board:
      return "foreign-board";
    case Refusal::too_few_views:
      return "too-few-views";
    case Refusal::square_size:
      return "square-size";
    case Refusal::camera_moved:
      return "camera-moved";
    case Refusal::cameras_swapped:
      return "cameras-swapped";
    case Refusal::no_floor:
      return "no-floor";
    case Refusal::inaccurate:
      return "inaccurate";
  }
  return "unknown";
}

Calibration calibrate(const CalibrationInput& in) {
  check(in);
  const int cameras = static_cast<int>(in.lenses.size());
  Calibration out;
  out.cameras.resize(in.lenses.size());
  const Usable use = usable(in);
  const int wrong = in.mirrored_pictures + in.foreign_pictures;
  if (use.sightings.empty() || wrong > static_cast<int>(use.sightings.size())) return without_board(in, std::move(out));
  for (const Sighting& s : use.sightings) ++out.cameras[static_cast<std::size_t>(s.camera)].pictures;

  // A wrong scale makes everything else wrong in ways that are harder to name.
  const double ratio = square_ratio(in, use);
  if (ratio > 0) {
    out.square_ratio = ratio;
    if (std::abs(ratio - 1) > in.limits.square)
      return refused(
          std::move(out), Refusal::square_size,
          text("by depth the board's squares measure %.1f mm, not %.1f: print it at 100 %% (no 'fit to page') and check it with its ruler, or say what "
               "the squares measure with --square",
               1000 * ratio * in.board.square, 1000 * in.board.square));
  } else {
    out.remarks.push_back("no depth was measured on the board: its size and the cameras' depth are not checked");
  }

  out.progress = progress(cameras, camera_pairs(cameras, use.sightings, use.poses), views_of_two(use.sightings, in.views), in.needs, {});
  if (!out.progress.enough && cameras > 1) {
    std::string sentence = too_few(in, out.progress);
    return refused(std::move(out), Refusal::too_few_views, std::move(sentence));
  }

  BundleState x = state_of(start_poses(cameras, in.views, use.sightings, use.poses));
  std::vector<char> left_out(use.sightings.size(), 0);
  BundleReport report = adjust(in.lenses, in.board, use.sightings, in.bundle, left_out, x);
  const BundleState all = x;
  const BundleReport all_report = report;
  for (int round = 0; round < 3; ++round) {
    const int count = leave_out_wrong(use.sightings, report, in.limits, left_out);
    out.left_out += count;
    if (count == 0) break;
    report = adjust(in.lenses, in.board, use.sightings, in.bundle, left_out, x);
  }
  out.errors = cross_validate(in.lenses, in.board, use.sightings, in.bundle, left_out, x, kFolds);
  const std::string inaccuracy = beyond(out.errors, in.limits, in.names);
  const bool many_left_out = out.left_out * 10 > static_cast<int>(use.sightings.size());
  // One picture that disagrees was misread; many may be those before or after a move.
  std::vector<Sighting> trusted;
  for (std::size_t i = 0; i < use.sightings.size(); ++i)
    if (many_left_out || !left_out[i]) trusted.push_back(use.sightings[i]);
  if (const auto moved = find_moved_camera(in.lenses, in.board, trusted, in.bundle, many_left_out ? all : x, many_left_out ? all_report : report))
    return refused(std::move(out), Refusal::camera_moved,
                   text("%s was moved before view %d (by %.0f mm and %.1f degrees): fasten it and begin again",
                        in.names[static_cast<std::size_t>(moved->camera)].c_str(), moved->view + 1, 1000 * moved->metres, moved->radians / kDegree));
  if (!inaccuracy.empty() || many_left_out) {
    if (!inaccuracy.empty())
      return refused(std::move(out), Refusal::inaccurate,
                     "measured on views that were held out, " + inaccuracy + ": capture again, with the board still and nearer");
    const int count = out.left_out;
    return refused(std::move(out), Refusal::inaccurate,
                   text("%d of %d pictures of the board disagree with the others: hold the board still while it is captured, and begin again", count,
                        static_cast<int>(use.sightings.size())));
  }
  if (out.left_out > 0) out.remarks.push_back(text("%d pictures of the board disagreed with all others and were left out", out.left_out));

  for (int c = 0; c < cameras; ++c) {
    auto& camera = out.cameras[static_cast<std::size_t>(c)];
    camera.depth = x.depth[static_cast<std::size_t>(c)];
    const auto block = report.covariance.block<6, 6>(6 * c, 6 * c);
    // Of the camera's place, not of the base's place in the camera: centre = -R^T t.
    const Rigid& pose = x.camera[static_cast<std::size_t>(c)];
    Eigen::Matrix<double, 3, 6> by_step;
    by_step << -pose.rotation.transpose() * cross_matrix(pose.translation), -pose.rotation.transpose();
    camera.position_sd_mm = 1000 * std::sqrt((by_step * block * by_step.transpose()).trace());
    camera.angle_sd_deg = std::sqrt(block.topLeftCorner<3, 3>().trace()) / kDegree;
    if (camera.position_sd_mm > in.limits.position_sd_mm || camera.angle_sd_deg > in.limits.angle_sd_deg)
      return refused(
          std::move(out), Refusal::inaccurate,
          text("%s is known to %.1f mm and %.2f degrees only (limits %.1f and %.2f): show the board in more places that it and its neighbours see",
               in.names[static_cast<std::size_t>(c)].c_str(), camera.position_sd_mm, camera.angle_sd_deg, in.limits.position_sd_mm, in.limits.angle_sd_deg));
  }

  const auto stand = centres(x);
  const auto points = room_points(in, x);
  const auto floor = find_floor(points, rough_up(x), stand);
  if (!floor)
    return refused(std::move(out), Refusal::no_floor, "no floor was found in the depth of the room: clear the stage so that the cameras see the floor");
  out.floor_rms_mm = 1000 * floor->rms;

  std::vector<Eigen::Vector3d> expected;
  for (const Rigid& e : in.expected) expected.push_back(e.translation);
  const auto board = board_on_floor(floor->plane, x, use.sightings, left_out);
  const Rigid level = board ? booth_from_board_on_floor(floor->plane, *board) : level_on(floor->plane);
  if (cameras >= 3 && !expected.empty()) {
    std::vector<Eigen::Vector3d> here;
    for (const auto& p : stand) here.push_back(level * p);
    std::string who;
    for (const auto& [a, b] : exchanged_cameras(here, expected, board ? EIGEN_PI / 3 : EIGEN_PI))
      who += (who.empty() ? "" : ", or ") + in.names[static_cast<std::size_t>(a)] + " and " + in.names[static_cast<std::size_t>(b)];
    if (!who.empty())
      return refused(std::move(out), Refusal::cameras_swapped,
                     who + " stand in each other's places: exchange their serials in cameras.kinect2.serials, or the cameras themselves");
  }
  out.origin_from_board = board.has_value();
  if (!board && expected.size() < 2)
    return refused(std::move(out), Refusal::no_floor,
                   "nothing says where the stage's middle is: lay the board there, print upwards and arrow to the front, and capture a view");
  const Rigid to_booth = board ? level : booth_from_layout(floor->plane, stand, expected);
  for (std::size_t c = 0; c < in.lenses.size(); ++c) out.cameras[c].booth_from_camera = to_booth * x.camera[c].inverse();
  return out;
}

Verification verify(const CalibrationInput& in, std::span<const CalibratedCamera> cameras) {
  check(in);
  if (cameras.size() != in.lenses.size()) throw std::invalid_argument("a calibration of other cameras cannot be verified");
  Verification out;
  const Usable use = usable(in);
  if (use.sightings.empty()) {
    Calibration none = without_board(in, {});
    out.sentence = none.sentence;
    return out;
  }
  BundleState x;
  for (const CalibratedCamera& c : cameras) x.camera.push_back(c.booth_from_camera.inverse()), x.depth.push_back(c.depth);
  out.errors = errors_on(in.lenses, in.board, use.sightings, in.bundle, {}, x);
  if (out.errors.views == 0) {
    out.sentence = "no two cameras saw the board in one view: hold it where two of them see its print";
    return out;
  }
  Usable corrected = use;
  for (Sighting& s : corrected.sightings)
    for (DepthSample& d : s.depth) d.z = x.depth[static_cast<std::size_t>(s.camera)].true_depth(d.z);
  const double ratio = square_ratio(in, corrected);
  if (ratio > 0 && std::abs(ratio - 1) > in.limits.square) {
    out.sentence =
        text("by depth the board's squares measure %.1f mm, not %.1f: is it the same board?", 1000 * ratio * in.board.square, 1000 * in.board.square);
    return out;
  }
  const std::string inaccuracy = beyond(out.errors, in.limits, in.names);
  out.good = inaccuracy.empty();
  out.sentence = out.good ? text("the calibration holds: corners %.2f px, %.1f mm between cameras, depth %.1f mm off the board", out.errors.reprojection_px,
                                 out.errors.corner_mm, out.errors.plane_mm)
                          : inaccuracy + ": a camera was moved, or its lens is dirty; calibrate again";
  return out;
}

}  // namespace booth::fit::calibrate

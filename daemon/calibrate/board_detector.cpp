// OpenCV's sector-based chessboard finder (Duda and Frese 2018) on an enlarged picture; dots and cells are read here.
#include "daemon/calibrate/board_detector.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

namespace booth::daemon {
namespace {

using fit::calibrate::Board;
using fit::calibrate::CellMatch;
using fit::calibrate::CellReading;

constexpr int kLeastColumns = 4, kLeastRows = 3;  // of inner corners

void check(const Grey16& p) {
  if (p.width < 16 || p.height < 16 || p.width > 4096 || p.height > 4096 ||
      p.pixels.size() != static_cast<std::size_t>(p.width) * static_cast<std::size_t>(p.height))
    throw std::invalid_argument("a picture of " + std::to_string(p.width) + " x " + std::to_string(p.height) + " pixels cannot hold " +
                                std::to_string(p.pixels.size()));
}

/// Square roots, so that a board three metres away keeps its contrast beside a hand half a metre away.
cv::Mat compressed(const Grey16& p) {
  std::vector<std::uint16_t> sorted(p.pixels.begin(), p.pixels.end());
  const auto bright = sorted.begin() + static_cast<std::ptrdiff_t>(0.995 * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), bright, sorted.end());
  const double scale = 250 / std::sqrt(std::max<double>(*bright, 1));
  cv::Mat out(p.height, p.width, CV_32F);
  for (int i = 0; i < p.width * p.height; ++i)
    out.ptr<float>()[i] = static_cast<float>(std::min(255.0, scale * std::sqrt(static_cast<double>(p.pixels[static_cast<std::size_t>(i)]))));
  return out;
}

/// A grid of corners, row by row.
struct Grid {
  int rows = 0, columns = 0;
  std::vector<cv::Point2f> at;
};

/// What is looked for, one after the other: a grid of exactly so many corners, or any that has at least so many.
struct Pattern {
  int columns, rows, enlarged;
  bool or_larger;
};

Grid find_grid(const cv::Mat& grey, const Pattern& pattern) {
  const int enlarged = pattern.enlarged;
  cv::Mat large = grey;
  if (enlarged > 1) cv::resize(grey, large, {}, enlarged, enlarged, cv::INTER_CUBIC);
  Grid grid;
  cv::Mat meta;
  if (!cv::findChessboardCornersSB(large, {pattern.columns, pattern.rows}, grid.at, cv::CALIB_CB_EXHAUSTIVE | (pattern.or_larger ? cv::CALIB_CB_LARGER : 0),
                                   meta))
    return {};
  grid.rows = pattern.or_larger ? meta.rows : pattern.rows, grid.columns = pattern.or_larger ? meta.cols : pattern.columns;
  if (grid.rows < 2 || grid.columns < 2 || static_cast<int>(grid.at.size()) != grid.rows * grid.columns) return {};
  for (auto& p : grid.at) {
    p.x = (p.x + 0.5f) / static_cast<float>(enlarged) - 0.5f;
    p.y = (p.y + 0.5f) / static_cast<float>(enlarged) - 0.5f;
  }
  // Rows and columns that a mirror would show are the finder's own order, not the print's.
  const auto at = [&](int r, int c) { return grid.at[static_cast<std::size_t>(r * grid.columns + c)]; };
  if ((at(0, grid.columns - 1) - at(0, 0)).cross(at(grid.rows - 1, 0) - at(0, 0)) < 0)
    for (int r = 0; r < grid.rows; ++r) std::reverse(grid.at.begin() + r * grid.columns, grid.at.begin() + (r + 1) * grid.columns);
  return grid;
}

/// The picture's brightness between pixels; NaN outside.
double sample(const Grey16& p, double u, double v) {
  if (!(u >= 0 && v >= 0 && u < p.width - 1 && v < p.height - 1)) return std::numeric_limits<double>::quiet_NaN();
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const double fx = u - x, fy = v - y;
  const auto at = [&](int i, int j) { return static_cast<double>(p.pixels[static_cast<std::size_t>(j * p.width + i)]); };
  return (1 - fy) * ((1 - fx) * at(x, y) + fx * at(x + 1, y)) + fy * ((1 - fx) * at(x, y + 1) + fx * at(x + 1, y + 1));
}

/// From places on the grid (1 a square; corner (r, c) at x = c, y = r) to pixels, over the whole grid. Distortion bends it by fractions of a pixel.
cv::Matx33d grid_to_pixels(const Grid& grid) {
  std::vector<cv::Point2f> from;
  for (int r = 0; r < grid.rows; ++r)
    for (int c = 0; c < grid.columns; ++c) from.emplace_back(static_cast<float>(c), static_cast<float>(r));
  const cv::Mat h = cv::findHomography(from, grid.at);
  return h.empty() ? cv::Matx33d::zeros() : cv::Matx33d(h);
}

/// Cells between the corners and those around them: dark or light, with or without a dot.
CellReading read_cells(const Grey16& picture, const Grid& grid) {
  const cv::Matx33d h = grid_to_pixels(grid);
  const auto at = [&](double x, double y) {
    const cv::Vec3d p = h * cv::Vec3d(x, y, 1);
    return sample(picture, p[0] / p[2], p[1] / p[2]);
  };
  CellReading out{grid.rows + 1, grid.columns + 1, {}, {}};
  std::vector<double> own, middle;
  for (int r = 0; r < out.rows; ++r)
    for (int c = 0; c < out.columns; ++c) {
      // A cell's colour between dot and border, and its middle.
      double ring = 0, centre = 0;
      for (int k = 0; k < 8; ++k) {
        const double angle = k * CV_PI / 4, radius = k % 2 == 0 ? 0.36 : 0.44;
        ring += at(c - 0.5 + radius * std::cos(angle), r - 0.5 + radius * std::sin(angle)) / 8;
        centre += at(c - 0.5 + 0.08 * std::cos(angle), r - 0.5 + 0.08 * std::sin(angle)) / 8;
      }
      own.push_back(ring), middle.push_back(centre);
    }
  for (int r = 0; r < out.rows; ++r)
    for (int c = 0; c < out.columns; ++c) {
      // Against the neighbours, which have the other colour: light falls off over the board.
      double other = 0;
      int count = 0;
      for (const auto& [dr, dc] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
        if (r + dr < 0 || c + dc < 0 || r + dr >= out.rows || c + dc >= out.columns) continue;
        const double value = own[static_cast<std::size_t>((r + dr) * out.columns + c + dc)];
        if (!std::isnan(value)) other += value, ++count;
      }
      const auto i = static_cast<std::size_t>(r * out.columns + c);
      const double contrast = count > 0 ? other / count - own[i] : std::numeric_limits<double>::quiet_NaN();
      out.dark.push_back(contrast);
      // 0: as the cell, 1: as its neighbours. A third is a dot that the lens has blurred.
      out.dot.push_back((middle[i] - own[i]) / contrast - 0.33);
    }
  return out;
}

/// Neighbouring cells differ everywhere: a chessboard, whosever it is.
bool alternates(const CellReading& reading) {
  int good = 0, judged = 0;
  for (int r = 0; r < reading.rows; ++r)
    for (int c = 0; c < reading.columns; ++c) {
      const double here = reading.dark[static_cast<std::size_t>(r * reading.columns + c)];
      if (std::isnan(here)) continue;
      const double first = reading.dark[static_cast<std::size_t>(reading.columns + 1)];  // an inner cell
      ++judged;
      good += ((r + c) % 2 == 0) == ((here > 0) == (first > 0));
    }
  return judged >= 12 && good * 10 >= judged * 9;
}

/// The board's corners that the grid holds, by their numbers; false where the grid and the match contradict each other.
bool number_corners(const Grid& grid, const CellReading& reading, const CellMatch& match, std::vector<int>& ids, std::vector<cv::Point2f>& at) {
  for (int r = 0; r < grid.rows; ++r)
    for (int c = 0; c < grid.columns; ++c) {
      // A corner is the middle of the four cells around it: the first row and column of these says which.
      int row = Board::kRows, column = Board::kColumns;
      for (const auto& [dr, dc] : {std::pair{0, 0}, {0, 1}, {1, 0}, {1, 1}}) {
        const auto [br, bc] = match.cell(reading, r + dr, c + dc);
        row = std::min(row, br), column = std::min(column, bc);
      }
      if (row < 0 || column < 0 || row >= Board::kCornerRows || column >= Board::kCornerColumns) return false;
      ids.push_back(row * Board::kCornerColumns + column);
      at.push_back(grid.at[static_cast<std::size_t>(r * grid.columns + c)]);
    }
  return true;
}

/// Whether places where the picture is a saddle, as it is at every corner of a chessboard, stand as close together as those of a board or a part of one.
/// Looking for a grid takes a hundred times as long.
bool may_hold_board(const cv::Mat& grey) {
  constexpr float kClear = 100, kAboveNoise = 7;  // a fortieth of what a corner of paper and toner shows three metres away; times the usual speck
  constexpr float kOfStrongest = 0.15f;           // of the twelfth strongest: seams and edges of a room are weaker than print
  constexpr std::size_t kFewest = kLeastColumns * kLeastRows;
  cv::Mat soft, xx, yy, xy;
  cv::GaussianBlur(grey, soft, {}, 1.2);
  cv::Sobel(soft, xx, CV_32F, 2, 0), cv::Sobel(soft, yy, CV_32F, 0, 2), cv::Sobel(soft, xy, CV_32F, 1, 1);
  const cv::Mat strength = xy.mul(xy) - xx.mul(yy);
  cv::Mat highest;
  cv::dilate(strength, highest, cv::Mat::ones(5, 5, CV_8U));
  struct Peak {
    float height;
    int x, y;
  };
  std::vector<Peak> peaks;
  for (int y = 0; y < strength.rows; ++y)
    for (int x = 0; x < strength.cols; ++x)
      if (strength.at<float>(y, x) >= highest.at<float>(y, x)) peaks.push_back({strength.at<float>(y, x), x, y});
  if (peaks.size() < kFewest) return false;
  std::sort(peaks.begin(), peaks.end(), [](const Peak& p, const Peak& q) { return p.height > q.height; });
  const float limit = std::max({kClear, kAboveNoise * peaks[peaks.size() / 2].height, kOfStrongest * peaks[kFewest - 1].height});
  while (!peaks.empty() && peaks.back().height <= limit) peaks.pop_back();
  for (const Peak& p : peaks) {
    int near = 0, around = 0;  // itself included
    for (const Peak& q : peaks) {
      const double d = std::hypot(p.x - q.x, p.y - q.y);
      near += d < 60, around += d < 100;
    }
    if (near >= 11 || around >= 12) return true;
  }
  return false;
}

/// Moves corners to where the picture's gradients cross, and finds those that the finder did not see, where the others say they are. A corner that the picture
/// does not show, because a hand or a reflection covers it, is dropped.
void refine_and_grow(const cv::Mat& grey, std::vector<int>& ids, std::vector<cv::Point2f>& at) {
  const Board unit{1};
  std::vector<cv::Point2f> from;
  for (const int id : ids) from.emplace_back(static_cast<float>(unit.corner(id).x()), static_cast<float>(-unit.corner(id).y()));
  const cv::Mat found = cv::findHomography(from, at);
  const std::vector<int> seen = ids;
  const std::vector<cv::Point2f> seen_at = at;
  ids.clear(), at.clear();
  if (found.empty()) return;
  const cv::Matx33d h(found);
  // Sharp edges of large squares fool the interpolation between pixels; small squares are blurred enough already.
  constexpr double kSharp = 9;  // pixels
  cv::Mat soft;
  cv::GaussianBlur(grey, soft, {}, 0.8);
  const auto place = [&](double x, double y) {
    const cv::Vec3d p = h * cv::Vec3d(x, -y, 1);
    return cv::Point2d(p[0] / p[2], p[1] / p[2]);
  };
  const auto inside = [&](const cv::Point2d& p, double margin) {
    return p.x > margin && p.y > margin && p.x < grey.cols - 1 - margin && p.y < grey.rows - 1 - margin;
  };
  for (int id = 0; id < Board::kCorners; ++id) {
    const Eigen::Vector3d c = unit.corner(id);
    const auto known = std::find(seen.begin(), seen.end(), id);
    const cv::Point2d guess = known != seen.end() ? cv::Point2d(seen_at[static_cast<std::size_t>(known - seen.begin())]) : place(c.x(), c.y());
    const double step =
        std::min(cv::norm(place(c.x() + 1, c.y()) - place(c.x(), c.y())), cv::norm(place(c.x(), c.y() + 1) - place(c.x(), c.y())));  // pixels a square
    // Small enough to hold no dot, whose edge begins 0.47 of a square from the corner.
    const int reach = std::clamp(static_cast<int>(0.3 * step), 2, 5);
    const cv::Mat& source = step > kSharp ? soft : grey;
    if (!inside(guess, reach + 3)) continue;
    std::vector<cv::Point2f> refined{guess};
    cv::cornerSubPix(source, refined, {reach, reach}, {-1, -1}, {cv::TermCriteria::EPS | cv::TermCriteria::COUNT, 40, 0.002});
    const cv::Point2d moved = cv::Point2d(refined[0]) - guess;
    if (!(cv::norm(moved) < 0.3 * step)) continue;
    // Light and dark in turn around it, as clearly as a board has them.
    const int row = id / Board::kCornerColumns, column = id % Board::kCornerColumns;
    double light[2], dark[2];
    int lights = 0, darks = 0;
    for (const auto& [dr, dc] : {std::pair{0, 0}, {0, 1}, {1, 0}, {1, 1}}) {
      const cv::Point2d p = guess + moved + place(c.x() + 0.25 * (2 * dc - 1), c.y() - 0.25 * (2 * dr - 1)) - place(c.x(), c.y());
      if (!inside(p, 1)) break;
      const double value = grey.at<float>(cvRound(p.y), cvRound(p.x));
      (Board::black(row + dr, column + dc) ? dark[darks++] : light[lights++]) = value;
    }
    if (lights != 2 || darks != 2) continue;
    const double brightest = std::max(light[0], light[1]), darkest = std::min(dark[0], dark[1]);
    if (std::min(light[0], light[1]) - std::max(dark[0], dark[1]) < 0.5 * (brightest - darkest) || brightest < 1.3 * darkest) continue;
    ids.push_back(id), at.push_back(refined[0]);
  }
}

fit::calibrate::Sighting sighting_of(std::vector<int> ids, const std::vector<cv::Point2f>& at) {
  fit::calibrate::Sighting out;
  out.corner = std::move(ids);
  out.pixel.resize(2, static_cast<Eigen::Index>(at.size()));
  for (std::size_t i = 0; i < at.size(); ++i) out.pixel.col(static_cast<Eigen::Index>(i)) = Eigen::Vector2d(at[i].x, at[i].y);
  return out;
}

}  // namespace

BoardDetection detect_board(const Grey16& infrared) {
  check(infrared);
  // Pictures are looked at side by side already; and a daemon that has narrowed its system calls may not load a library's threads.
  [[maybe_unused]] static const bool on_one_thread = (cv::setNumThreads(0), true);
  const cv::Mat smooth = compressed(infrared);
  BoardDetection out;
  if (!may_hold_board(smooth)) return out;
  cv::Mat grey;
  smooth.convertTo(grey, CV_8U);
  // The whole board, parts of it as an arm or the picture's border leaves them, and the whole board enlarged.
  constexpr int w = Board::kCornerColumns, h = Board::kCornerRows;
  for (const Pattern& pattern : {Pattern{w, h, 1, false},
                                 {w - 1, h, 1, false},
                                 {w - 2, h, 1, false},
                                 {kLeastColumns, kLeastRows, 1, true},
                                 {w, h - 1, 1, false},
                                 {w - 1, h - 1, 1, false},
                                 {w, h, 2, false}}) {
    const Grid grid = find_grid(grey, pattern);
    if (grid.at.empty()) continue;
    const CellReading reading = read_cells(infrared, grid);
    const CellMatch match = match_cells(reading);
    if (match.verdict == CellMatch::Verdict::mirrored) out.kind = BoardDetection::Kind::mirrored;
    if (match.verdict == CellMatch::Verdict::foreign && out.kind == BoardDetection::Kind::none && alternates(reading)) out.kind = BoardDetection::Kind::foreign;
    std::vector<int> ids;
    std::vector<cv::Point2f> at;
    if (match.verdict != CellMatch::Verdict::board || !number_corners(grid, reading, match, ids, at)) continue;
    refine_and_grow(smooth, ids, at);
    if (ids.size() < static_cast<std::size_t>(kLeastColumns * kLeastRows)) continue;
    out.kind = BoardDetection::Kind::board;
    out.sighting = sighting_of(std::move(ids), at);
    return out;
  }
  return out;
}

std::optional<fit::calibrate::Sighting> sight_board_at(const Grey16& infrared, const Eigen::Matrix2Xd& corners) {
  check(infrared);
  if (corners.cols() != Board::kCorners || !corners.allFinite() || corners.cwiseAbs().maxCoeff() > 1e5) return std::nullopt;
  std::vector<int> ids;
  std::vector<cv::Point2f> at;
  for (int id = 0; id < Board::kCorners; ++id) {
    ids.push_back(id);
    at.emplace_back(static_cast<float>(corners(0, id)), static_cast<float>(corners(1, id)));
  }
  refine_and_grow(compressed(infrared), ids, at);
  if (ids.size() < static_cast<std::size_t>(kLeastColumns * kLeastRows)) return std::nullopt;
  return sighting_of(std::move(ids), at);
}

void add_board_depth(const Grey16& depth, double metres, const fit::calibrate::Lens& lens, const Board& board, fit::calibrate::Sighting& sighting) {
  check(depth);
  sighting.depth.clear();
  if (depth.width != lens.width || depth.height != lens.height) return;
  const auto pose = pose_of_board(lens, board, sighting);
  if (!pose) return;
  constexpr double kFromBorder = 0.2, kFromDot = Board::kDotRadius + 0.12;  // squares
  constexpr std::size_t kMost = 100;
  const Eigen::Vector2d low = sighting.pixel.rowwise().minCoeff(), high = sighting.pixel.rowwise().maxCoeff();
  const double reach = 0.5 * (high - low).maxCoeff();
  std::vector<fit::calibrate::DepthSample> all;
  const fit::calibrate::Rigid to_board = pose->camera_from_board.inverse();
  for (int v = std::max(0, static_cast<int>(low.y() - reach)); v <= std::min(depth.height - 1, static_cast<int>(high.y() + reach)); ++v)
    for (int u = std::max(0, static_cast<int>(low.x() - reach)); u <= std::min(depth.width - 1, static_cast<int>(high.x() + reach)); ++u) {
      const std::uint16_t count = depth.pixels[static_cast<std::size_t>(v * depth.width + u)];
      if (count == 0) continue;
      const Eigen::Vector2d ray = lens.ray({u, v});
      const double z = depth_of_plane(pose->camera_from_board, ray.x(), ray.y());
      if (!std::isfinite(z)) continue;
      const Eigen::Vector3d on = to_board * Eigen::Vector3d(z * ray.homogeneous());
      const double c = on.x() / board.square + 0.5 * Board::kColumns, r = 0.5 * Board::kRows - on.y() / board.square;
      if (c < 0 || r < 0 || c >= Board::kColumns || r >= Board::kRows) continue;
      const int column = static_cast<int>(c), row = static_cast<int>(r);
      const double x = c - column - 0.5, y = r - row - 0.5;
      if (Board::black(row, column) || std::max(std::abs(x), std::abs(y)) > 0.5 - kFromBorder) continue;
      if (Board::dotted(row, column) && std::hypot(x, y) < kFromDot) continue;
      const double measured = count * metres;
      // What stands before the board is not the board.
      if (std::abs(measured / z - 1) < 0.15) all.push_back({ray.x(), ray.y(), measured});
    }
  const std::size_t stride = std::max<std::size_t>(1, (all.size() + kMost - 1) / kMost);
  for (std::size_t i = 0; i < all.size(); i += stride) sighting.depth.push_back(all[i]);
}

std::vector<fit::calibrate::DepthSample> room_depth(const Grey16& depth, double metres, const fit::calibrate::Lens& lens, int count) {
  check(depth);
  std::vector<fit::calibrate::DepthSample> out;
  if (depth.width != lens.width || depth.height != lens.height || count <= 0) return out;
  const int stride = std::max(1, static_cast<int>(std::sqrt(static_cast<double>(depth.width) * depth.height / count)));
  for (int v = stride / 2; v < depth.height; v += stride)
    for (int u = stride / 2; u < depth.width; u += stride)
      if (const std::uint16_t z = depth.pixels[static_cast<std::size_t>(v * depth.width + u)]; z > 0) {
        const Eigen::Vector2d ray = lens.ray({u, v});
        out.push_back({ray.x(), ray.y(), z * metres});
      }
  return out;
}

}  // namespace booth::daemon

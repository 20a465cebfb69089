// A plan of the floor from all pictures, the print laid on every place of it, and the best place refined in the pictures themselves.
#include "daemon/calibrate/floor_board.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace booth::daemon {
namespace {

using fit::calibrate::Board;
using fit::calibrate::Rigid;

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
constexpr int kAcross = 4;         ///< pixels of the plan to a square
constexpr int kHeadings = 96;      ///< a corner of the board moves by a seventh of a square from one to the next
constexpr double kFarthest = 2.3;  ///< squares: half a board and what lies around it, for local brightness

/// A place on the print and what is printed there: +1 white, -1 black.
struct Mark {
  double x, y;  // metres, board frame
  float tone;
};

/// The middle of each cell and four places between its dot and its border.
std::vector<Mark> marks_of(const Board& board) {
  std::vector<Mark> out;
  const auto add = [&](double column, double row, bool black) {
    out.push_back({(column - 0.5 * Board::kColumns) * board.square, (0.5 * Board::kRows - row) * board.square, black ? -1.0f : 1.0f});
  };
  for (int r = 0; r < Board::kRows; ++r)
    for (int c = 0; c < Board::kColumns; ++c) {
      const bool black = Board::black(r, c);
      add(c + 0.5, r + 0.5, black != Board::dotted(r, c));
      for (const double dx : {-0.27, 0.27})
        for (const double dy : {-0.27, 0.27}) add(c + 0.5 + dx, r + 0.5 + dy, black);
    }
  float mean = 0;
  for (const Mark& m : out) mean += m.tone / static_cast<float>(out.size());
  for (Mark& m : out) m.tone -= mean;
  return out;
}

/// Brightness between pixels; NaN outside and behind.
double brightness(const FloorPicture& p, const Eigen::Vector3d& on_floor) {
  const Eigen::Vector3d at = p.camera_from_floor * on_floor;
  if (!(at.z() > 0.1)) return kNothing;
  const Eigen::Vector2d pixel = p.lens.project(at);
  const double u = pixel.x(), v = pixel.y();
  if (!(u >= 0 && v >= 0 && u < p.infrared.width - 1 && v < p.infrared.height - 1)) return kNothing;
  const int x = static_cast<int>(u), y = static_cast<int>(v);
  const double fx = u - x, fy = v - y;
  const auto value = [&](int i, int j) { return static_cast<double>(p.infrared.pixels[static_cast<std::size_t>(j * p.infrared.width + i)]); };
  return (1 - fy) * ((1 - fx) * value(x, y) + fx * value(x + 1, y)) + fy * ((1 - fx) * value(x, y + 1) + fx * value(x + 1, y + 1));
}

/// A square map of the floor.
struct Plan {
  int side = 0;
  double pixel = 0;  // metres
  std::vector<float> value;
  double metres(int i) const { return (i - 0.5 * (side - 1)) * pixel; }
  float& at(int x, int y) { return value[static_cast<std::size_t>(y * side + x)]; }
};

/// Sums over all rectangles from the first pixel on, so that the mean of any is four look-ups.
std::vector<double> sums_of(const std::vector<float>& value, int side) {
  const int row = side + 1;
  std::vector<double> sum(static_cast<std::size_t>(row * row), 0);
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      sum[static_cast<std::size_t>((y + 1) * row + x + 1)] = static_cast<double>(value[static_cast<std::size_t>(y * side + x)]) +
                                                             sum[static_cast<std::size_t>(y * row + x + 1)] + sum[static_cast<std::size_t>((y + 1) * row + x)] -
                                                             sum[static_cast<std::size_t>(y * row + x)];
  return sum;
}

/// What a picture shows of the floor, each place against its surroundings: 0 as they are, about +-1 for white and black print. Outside the picture: 0.
Plan plan_of(const FloorPicture& picture, int side, double pixel) {
  Plan plan{side, pixel, std::vector<float>(static_cast<std::size_t>(side * side), 0)};
  std::vector<float> there(plan.value.size(), 0);
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) {
      const double b = brightness(picture, {plan.metres(x), plan.metres(y), 0});
      if (std::isnan(b)) continue;
      // The lamp is the camera's own: brightness falls with the square of the distance, and a print near the lens must not outshine one far away.
      plan.at(x, y) = static_cast<float>(std::sqrt(std::max(b, 0.0)));
      there[static_cast<std::size_t>(y * side + x)] = 1;
    }
  std::vector<float> square(plan.value.size());
  for (std::size_t i = 0; i < square.size(); ++i) square[i] = plan.value[i] * plan.value[i];
  const auto sum = sums_of(plan.value, side), sum2 = sums_of(square, side), count = sums_of(there, side);
  const int reach = static_cast<int>(kFarthest * kAcross), row = side + 1;
  Plan out{side, pixel, std::vector<float>(plan.value.size(), 0)};
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) {
      if (there[static_cast<std::size_t>(y * side + x)] == 0) continue;
      const int x0 = std::max(0, x - reach), x1 = std::min(side, x + reach + 1), y0 = std::max(0, y - reach), y1 = std::min(side, y + reach + 1);
      const auto over = [&](const std::vector<double>& s) {
        return s[static_cast<std::size_t>(y1 * row + x1)] - s[static_cast<std::size_t>(y0 * row + x1)] - s[static_cast<std::size_t>(y1 * row + x0)] +
               s[static_cast<std::size_t>(y0 * row + x0)];
      };
      const double n = over(count), mean = over(sum) / n, sd = std::sqrt(std::max(over(sum2) / n - mean * mean, 0.0));
      constexpr double kLeastContrast = 0.03;  // of the brightness around: what is flatter is floor
      out.at(x, y) = static_cast<float>(std::clamp((static_cast<double>(plan.at(x, y)) - mean) / std::max(sd, kLeastContrast * mean + 1e-6), -2.0, 2.0));
    }
  return out;
}

struct Place {
  double x = 0, y = 0, heading = 0, score = -1;
};

Rigid rigid_of(const Place& p) { return {Eigen::AngleAxisd(p.heading, Eigen::Vector3d::UnitZ()).toRotationMatrix(), {p.x, p.y, 0}}; }

/// The same place, as far as the search can tell.
bool beside(const Place& a, const Place& b, double square) {
  return std::hypot(a.x - b.x, a.y - b.y) < 0.6 * square && std::abs(std::remainder(a.heading - b.heading, 2 * EIGEN_PI)) < 0.2;
}

/// The few best places of the plan, each another one.
std::vector<Place> search_plan(const Plan& plan, const std::vector<Mark>& marks, const Board& board, double reach) {
  constexpr std::size_t kKept = 6;
  std::vector<Place> best;
  const int half = static_cast<int>(reach / plan.pixel), middle = plan.side / 2;
  std::vector<int> offset(marks.size());
  for (int k = 0; k < kHeadings; ++k) {
    const double heading = 2 * EIGEN_PI * k / kHeadings, c = std::cos(heading), s = std::sin(heading);
    for (std::size_t i = 0; i < marks.size(); ++i) {
      const auto& m = marks[i];
      offset[i] = static_cast<int>(std::lround((s * m.x + c * m.y) / plan.pixel)) * plan.side + static_cast<int>(std::lround((c * m.x - s * m.y) / plan.pixel));
    }
    for (int y = middle - half; y <= middle + half; ++y)
      for (int x = middle - half; x <= middle + half; ++x) {
        const float* at = plan.value.data() + y * plan.side + x;
        float sum = 0;
        for (std::size_t i = 0; i < marks.size(); ++i) sum += marks[i].tone * at[offset[i]];
        const Place here{plan.metres(x), plan.metres(y), heading, static_cast<double>(sum) / static_cast<double>(marks.size())};
        if (best.size() == kKept && here.score <= best.back().score) continue;
        const auto same = std::find_if(best.begin(), best.end(), [&](const Place& p) { return beside(p, here, board.square); });
        if (same != best.end()) {
          if (same->score >= here.score) continue;
          *same = here;
        } else if (best.size() < kKept) {
          best.push_back(here);
        } else {
          best.back() = here;
        }
        std::sort(best.begin(), best.end(), [](const Place& p, const Place& q) { return p.score > q.score; });
      }
  }
  return best;
}

/// Correlation of what a picture shows at the marks with the print; 0 where more than a quarter of them is not in it.
double likeness(const FloorPicture& picture, const std::vector<Mark>& marks, const Rigid& floor_from_board) {
  double n = 0, sum = 0, sum2 = 0, tones = 0, tones2 = 0, both = 0;
  for (const Mark& m : marks) {
    const double b = brightness(picture, floor_from_board * Eigen::Vector3d(m.x, m.y, 0)), tone = static_cast<double>(m.tone);
    if (std::isnan(b)) continue;
    ++n, sum += b, sum2 += b * b, tones += tone, tones2 += tone * tone, both += tone * b;
  }
  if (n < 0.75 * static_cast<double>(marks.size())) return 0;
  const double spread = (n * sum2 - sum * sum) * (n * tones2 - tones * tones);
  return spread > 1e-9 ? (n * both - sum * tones) / std::sqrt(spread) : 0;
}

/// A camera before which somebody stands says nothing, so only what is alike counts.
double together(std::span<const FloorPicture> pictures, const std::vector<Mark>& marks, const Place& place) {
  double sum = 0;
  for (const auto& p : pictures) sum += std::pow(std::max(likeness(p, marks, rigid_of(place)), 0.0), 2);
  return sum;
}

void refine(std::span<const FloorPicture> pictures, const std::vector<Mark>& marks, const Board& board, Place& place) {
  place.score = together(pictures, marks, place);
  for (double step = 0.16; step > 0.01; step *= 0.5)
    for (bool better = true; better;) {
      better = false;
      for (int k = 0; k < 6; ++k) {
        Place next = place;
        const double by = (k % 2 == 0 ? 1 : -1) * step;
        if (k / 2 == 0) next.x += by * board.square;
        if (k / 2 == 1) next.y += by * board.square;
        if (k / 2 == 2) next.heading += by / 3;  // the far cells move as much
        next.score = together(pictures, marks, next);
        if (next.score > place.score + 1e-9) place = next, better = true;
      }
    }
}

}  // namespace

std::optional<FloorBoard> find_board_on_floor(std::span<const FloorPicture> pictures, const Board& board, const FloorSearch& search) {
  if (pictures.empty() || !(board.square > 0.005) || !(search.reach > 0)) return std::nullopt;
  const double pixel = board.square / kAcross, half = search.reach + 0.5 * std::hypot(board.width(), board.height()) + 2 * pixel;
  constexpr int kLargest = 801;
  const int side = std::min(kLargest, 2 * static_cast<int>(half / pixel) + 1);
  const int middle = side / 2;
  const double reach = std::min(search.reach, (middle - 2) * pixel - 0.5 * std::hypot(board.width(), board.height()));
  if (!(reach > 0)) return std::nullopt;
  Plan plan{side, pixel, std::vector<float>(static_cast<std::size_t>(side * side), 0)};
  for (const auto& p : pictures) {
    const Plan one = plan_of(p, side, pixel);
    for (std::size_t i = 0; i < plan.value.size(); ++i) plan.value[i] += one.value[i];
  }
  const auto marks = marks_of(board);
  std::vector<Place> places = search_plan(plan, marks, board, reach);
  for (Place& p : places) refine(pictures, marks, board, p);
  std::sort(places.begin(), places.end(), [](const Place& p, const Place& q) { return p.score > q.score; });
  if (places.empty()) return std::nullopt;
  FloorBoard out{rigid_of(places.front()), {}};
  for (const auto& p : pictures) out.likeness.push_back(likeness(p, marks, out.floor_from_board));
  const double best = *std::max_element(out.likeness.begin(), out.likeness.end());
  if (best < search.likeness) return std::nullopt;
  for (const Place& other : places) {
    if (beside(other, places.front(), board.square)) continue;
    double rival = 0;
    for (const auto& p : pictures) rival = std::max(rival, likeness(p, marks, rigid_of(other)));
    if (rival > best - search.margin) return std::nullopt;
  }
  return out;
}

}  // namespace booth::daemon

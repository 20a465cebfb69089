// Draws bones as lines of characters.
#include "daemon/ctl/stick_figure.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "fit/body/skeleton.hpp"

namespace booth::daemon {
namespace {

/// What came over the network may be any numbers; these are such that every sum of them is a place on a grid, if not on this one.
bool drawable(const std::array<double, 3>& joint) { return std::abs(joint[1]) < 100 && std::abs(joint[2]) < 100; }

}  // namespace

std::string stick_figure(std::span<const std::array<double, 3>, 24> joints, int columns, int rows) {
  constexpr double kWidth = 2.0, kHeight = 2.2;  // metres shown
  std::vector<std::string> grid(static_cast<std::size_t>(rows), std::string(static_cast<std::size_t>(columns), ' '));
  // The viewer stands in front and looks along -x: the person's left (+y) is on the viewer's right.
  const double middle = drawable(joints[0]) ? joints[0][1] : 0;
  const auto column = [&](double y) { return (y - middle + kWidth / 2) / kWidth * (columns - 1); };
  const auto row = [&](double z) { return (1 - z / kHeight) * (rows - 1); };
  const auto put = [&](double c, double r, char mark) {
    const auto ci = static_cast<long>(std::lround(c)), ri = static_cast<long>(std::lround(r));
    if (ci >= 0 && ri >= 0 && ci < columns && ri < rows) grid[static_cast<std::size_t>(ri)][static_cast<std::size_t>(ci)] = mark;
  };
  for (std::size_t b = 1; b < joints.size(); ++b) {
    const auto& from = joints[static_cast<std::size_t>(fit::start_joint(static_cast<int>(b)))];
    const auto& to = joints[b];
    if (!drawable(from) || !drawable(to)) continue;
    const double c0 = column(from[1]), c1 = column(to[1]), r0 = row(from[2]), r1 = row(to[2]);
    // A character is twice as high as wide.
    const double dc = c1 - c0, dr = 2 * (r1 - r0);
    const char mark = std::abs(dc) < 0.5 * std::abs(dr) ? '|' : std::abs(dr) < 0.5 * std::abs(dc) ? '-' : (dc > 0) == (dr > 0) ? '\\' : '/';
    const int steps = std::clamp(static_cast<int>(2 * std::max(std::abs(c1 - c0), std::abs(r1 - r0))) + 1, 1, 1000);
    for (int s = 0; s <= steps; ++s) put(c0 + (c1 - c0) * s / steps, r0 + (r1 - r0) * s / steps, mark);
  }
  for (const auto& joint : joints) {
    if (drawable(joint)) put(column(joint[1]), row(joint[2]), 'o');
  }
  const auto& head = joints[static_cast<std::size_t>(fit::joint_index("head_top"))];
  if (drawable(head)) put(column(head[1]), row(head[2]), '@');
  std::string out;
  for (auto& line : grid) out += line + "\n";
  return out;
}

}  // namespace booth::daemon

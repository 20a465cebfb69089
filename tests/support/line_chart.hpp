// Curves as an SVG picture, for benchmarks and studies whose answer is a curve.
#pragma once

#include <string>
#include <vector>

namespace booth::tests {

struct LineChart {
  struct Line {
    std::string name;
    std::vector<double> x, y;  ///< of the same length
  };
  std::string title, x_label, y_label;
  bool log_x = false, log_y = false;
  std::vector<Line> lines;
};

/// A whole SVG document, 900 x 560, readable without a script. Points that are not finite (or not positive on a logarithmic axis) are left out.
/// Throws std::invalid_argument where there is nothing to draw.
std::string to_svg(const LineChart& chart);

}  // namespace booth::tests

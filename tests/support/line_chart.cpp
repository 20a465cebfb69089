// Axes with round ticks, one colour and one dash pattern a line, names beside the picture.
#include "tests/support/line_chart.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace booth::tests {
namespace {

constexpr double kLeft = 70, kRight = 620, kTop = 40, kBottom = 500, kWidth = 900, kHeight = 560;
// Okabe and Ito's palette: told apart by colour-blind readers too.
constexpr std::array<const char*, 8> kColours{"#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999"};

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

/// From values to pixels.
struct Axis {
  bool log;
  double low = std::numeric_limits<double>::infinity(), high = -low, first, last;  ///< pixels of low and high

  bool takes(double v) const { return std::isfinite(v) && (!log || v > 0); }
  void include(double v) {
    if (!takes(v)) return;
    low = std::min(low, log ? std::log10(v) : v);
    high = std::max(high, log ? std::log10(v) : v);
  }
  void widen() {
    if (!log) low = std::min(low, 0.0);
    if (high <= low) high = low + 1;
  }
  double pixel(double v) const { return first + (last - first) * ((log ? std::log10(v) : v) - low) / (high - low); }
  std::vector<double> ticks() const {
    std::vector<double> out;
    if (log) {
      for (double e = std::ceil(low - 1e-9); e <= high + 1e-9; ++e) out.push_back(std::pow(10.0, e));
      return out;
    }
    const double raw = (high - low) / 6, power = std::pow(10.0, std::floor(std::log10(raw)));
    const double step = power * (raw / power < 1.5 ? 1 : raw / power < 3.5 ? 2 : raw / power < 7.5 ? 5 : 10);
    for (double v = std::ceil(low / step - 1e-9) * step; v <= high + 1e-9 * step; v += step) out.push_back(std::abs(v) < 1e-12 ? 0 : v);
    return out;
  }
};

}  // namespace

std::string to_svg(const LineChart& chart) {
  Axis x{.log = chart.log_x, .first = kLeft, .last = kRight}, y{.log = chart.log_y, .first = kBottom, .last = kTop};
  for (const auto& line : chart.lines)
    for (std::size_t i = 0; i < std::min(line.x.size(), line.y.size()); ++i) {
      if (!x.takes(line.x[i]) || !y.takes(line.y[i])) continue;
      x.include(line.x[i]);
      y.include(line.y[i]);
    }
  if (!std::isfinite(x.low) || !std::isfinite(y.low)) throw std::invalid_argument("line chart \"" + chart.title + "\" has no point to draw");
  if (!x.log && x.low > 0.5 * x.high) x.low = std::min(x.low, x.high - 1e-9);  // a narrow range far from zero keeps its own scale
  y.widen();
  if (x.high <= x.low) x.high = x.low + 1;

  std::string out =
      fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" font-size=\"13\">\n", kWidth, kHeight);
  out += fmt::format("<rect width=\"{}\" height=\"{}\" fill=\"white\"/>\n<text x=\"{}\" y=\"24\" font-size=\"16\">{}</text>\n", kWidth, kHeight, kLeft,
                     escaped(chart.title));
  for (const double t : x.ticks())
    out += fmt::format("<path d=\"M{0:.1f} {1}V{2}\" stroke=\"#ddd\"/><text x=\"{0:.1f}\" y=\"{3}\" text-anchor=\"middle\">{4:g}</text>\n", x.pixel(t), kTop,
                       kBottom, kBottom + 18, t);
  for (const double t : y.ticks())
    out += fmt::format("<path d=\"M{1} {0:.1f}H{2}\" stroke=\"#ddd\"/><text x=\"{3}\" y=\"{4:.1f}\" text-anchor=\"end\">{5:g}</text>\n", y.pixel(t), kLeft,
                       kRight, kLeft - 6, y.pixel(t) + 4, t);
  out += fmt::format("<path d=\"M{0} {1}V{2}H{3}\" stroke=\"black\" fill=\"none\"/>\n", kLeft, kTop, kBottom, kRight);
  out += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n", (kLeft + kRight) / 2, kBottom + 42, escaped(chart.x_label));
  out += fmt::format("<text transform=\"translate(20 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n", (kTop + kBottom) / 2, escaped(chart.y_label));
  for (std::size_t l = 0; l < chart.lines.size(); ++l) {
    const auto& line = chart.lines[l];
    const char* colour = kColours[l % kColours.size()];
    const char* dash = l < kColours.size() ? "" : " stroke-dasharray=\"6 3\"";
    std::string points;
    for (std::size_t i = 0; i < std::min(line.x.size(), line.y.size()); ++i)
      if (x.takes(line.x[i]) && y.takes(line.y[i])) points += fmt::format("{:.1f},{:.1f} ", x.pixel(line.x[i]), y.pixel(line.y[i]));
    out += fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"{}/>\n", points, colour, dash);
    const double at = kTop + 20 * static_cast<double>(l);
    out += fmt::format("<path d=\"M{0} {1}h24\" stroke=\"{2}\" stroke-width=\"2\"{3}/><text x=\"{4}\" y=\"{5}\">{6}</text>\n", kRight + 16, at + 8, colour,
                       dash, kRight + 46, at + 12, escaped(line.name));
  }
  return out + "</svg>\n";
}

}  // namespace booth::tests

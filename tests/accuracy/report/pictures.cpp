// No display and no library of charts is needed.
#include "tests/accuracy/report/pictures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "daemon/io/atomic_file.hpp"
#include "daemon/io/fit_picture.hpp"
#include "daemon/io/png_image.hpp"
#include "tests/accuracy/booth/errors.hpp"

namespace booth::accuracy {
namespace {

constexpr float kRed = 0.03f;  // m

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : std::string(1, c);
  return out;
}

}  // namespace

void draw_errors(const std::filesystem::path& path, const Subject& subject, const fit::PoseVector& truth, const std::vector<ErrorView>& views) {
  const fit::Faces& faces = subject.model->data().faces;
  const float c = static_cast<float>(std::cos(truth[4])), s = static_cast<float>(std::sin(truth[4]));
  const fit::Vertices surface = subject.surface(truth);
  const auto from = [&](float side) { return daemon::SceneStyle{.width = 320, .height = 360, .from = {side * s, 0.1f, side * c}, .metres_high = 2.2f}; };
  const daemon::SceneItem truth_item{surface, &faces};
  std::vector<daemon::Picture> row{daemon::draw_scene({&truth_item, 1}, "truth", from(1))};
  for (const ErrorView& view : views) {
    std::vector<daemon::Colour> colours;
    for (const float d : surface_distances(view.vertices, subject, truth)) colours.push_back(daemon::heat(d, kRed));
    const daemon::SceneItem item{view.vertices, &faces, &colours};
    for (const float side : {1.0f, -1.0f}) row.push_back(daemon::draw_scene({&item, 1}, view.caption, from(side)));
  }
  daemon::write_png(path, daemon::Picture::beside(row));
}

void draw_curves(const std::filesystem::path& path, const std::string& title, const std::string& x, const std::string& y, const std::vector<Curve>& curves) {
  constexpr double kWidth = 640, kHeight = 400, kLeft = 70, kRight = 20, kTop = 40, kBottom = 50;
  static constexpr const char* kColours[]{"#1f5fa8", "#c0392b", "#2e8b57", "#8e44ad", "#b7791f"};
  double low_x = 1e300, high_x = -1e300, high_y = 0;
  for (const Curve& curve : curves)
    for (const auto& [px, py] : curve.points) low_x = std::min(low_x, px), high_x = std::max(high_x, px), high_y = std::max(high_y, py);
  if (!(high_x > low_x)) low_x = 0, high_x = 1;
  if (!(high_y > 0)) high_y = 1;
  const auto at_x = [&](double v) { return kLeft + (v - low_x) / (high_x - low_x) * (kWidth - kLeft - kRight); };
  const auto at_y = [&](double v) { return kHeight - kBottom - v / high_y * (kHeight - kTop - kBottom); };
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" font-family=\"sans-serif\" font-size=\"12\">\n"
      "<rect width=\"{0}\" height=\"{1}\" fill=\"white\"/>\n<text x=\"{2}\" y=\"20\" font-size=\"14\">{3}</text>\n",
      kWidth, kHeight, kLeft, escaped(title));
  for (int i = 0; i <= 4; ++i) {
    const double vy = high_y * i / 4, vx = low_x + (high_x - low_x) * i / 4;
    out += fmt::format("<line x1=\"{:.1f}\" x2=\"{:.1f}\" y1=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"#dddddd\"/>\n", kLeft, kWidth - kRight, at_y(vy), at_y(vy));
    out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{:.3g}</text>\n", kLeft - 6, at_y(vy) + 4, vy);
    out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{:.3g}</text>\n", at_x(vx), kHeight - kBottom + 18, vx);
  }
  out += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n", (kLeft + kWidth) / 2, kHeight - 10, escaped(x));
  out += fmt::format("<text x=\"16\" y=\"{0:.1f}\" text-anchor=\"middle\" transform=\"rotate(-90 16 {0:.1f})\">{1}</text>\n", kHeight / 2, escaped(y));
  for (std::size_t k = 0; k < curves.size(); ++k) {
    out += fmt::format("<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"2\" points=\"", kColours[k % 5]);
    for (const auto& [px, py] : curves[k].points) out += fmt::format("{:.1f},{:.1f} ", at_x(px), at_y(py));
    out += fmt::format("\"/>\n<text x=\"{:.1f}\" y=\"{:.1f}\" fill=\"{}\" text-anchor=\"end\">{}</text>\n", kWidth - kRight - 6,
                       kTop + 16.0 * static_cast<double>(k + 1), kColours[k % 5], escaped(curves[k].name));
  }
  daemon::write_file_atomically(path, out + "</svg>\n");
}

}  // namespace booth::accuracy

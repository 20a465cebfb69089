// No display and no library of charts is needed.
#include "tests/accuracy/report/pictures.hpp"

#include <cmath>

#include "daemon/io/atomic_file.hpp"
#include "daemon/io/fit_picture.hpp"
#include "daemon/io/png_image.hpp"
#include "tests/accuracy/booth/errors.hpp"
#include "tests/support/line_chart.hpp"

namespace booth::accuracy {
namespace {

constexpr float kRed = 0.03f;  // m

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
  tests::LineChart chart{.title = title, .x_label = x, .y_label = y, .lines = {}};
  for (const Curve& curve : curves) {
    tests::LineChart::Line line{curve.name, {}, {}};
    for (const auto& [px, py] : curve.points) line.x.push_back(px), line.y.push_back(py);
    chart.lines.push_back(std::move(line));
  }
  daemon::write_file_atomically(path, tests::to_svg(chart));
}

}  // namespace booth::accuracy

// Pictures of the study: error-coloured bodies from two sides as PNG, curves as SVG.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/accuracy/booth/subjects.hpp"

namespace booth::accuracy {

struct ErrorView {
  std::string caption;
  fit::Vertices vertices;  ///< fitted; template topology, CMU frame
};

/// One row: the true body in grey, then each fitted one from its front and its back, blue at 0 to red at 3 cm and more from the true surface.
/// Throws as write_png() does.
void draw_errors(const std::filesystem::path& path, const Subject& subject, const fit::PoseVector& truth, const std::vector<ErrorView>& views);

struct Curve {
  std::string name;
  std::vector<std::pair<double, double>> points;
};

/// A line chart as SVG. Throws as write_file_atomically() and to_svg() do.
void draw_curves(const std::filesystem::path& path, const std::string& title, const std::string& x, const std::string& y, const std::vector<Curve>& curves);

}  // namespace booth::accuracy

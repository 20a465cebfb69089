// XYZ: a point a line, three numbers or more; six whose last three are a unit vector are a point and its normal.
#include <cmath>

#include "daemon/io/cloud_readers.hpp"
#include "daemon/io/mesh_file.hpp"
#include "daemon/io/text_scanner.hpp"

namespace booth::daemon {

RawCloud parse_xyz(std::string_view bytes) {
  RawCloud out;
  TextScanner text(bytes);
  bool all_normals = true;
  while (text.next_line()) {
    std::string_view w = text.word();
    if (w.empty() || w.front() == '#' || w.substr(0, 2) == "//") continue;
    std::array<float, 6> v{};
    int n = 0;
    for (; !w.empty() && n < 6; w = text.word(), ++n)
      if (!parse_number(w, v[static_cast<std::size_t>(n)])) throw ParseError(text.where() + ": '" + std::string(w.substr(0, 40)) + "' is not a number");
    // A lone count on the first line is how some programs announce what follows.
    if (n == 1 && out.points.empty()) continue;
    if (n < 3) throw ParseError(text.where() + ": a point needs three numbers");
    if (out.points.size() == static_cast<std::size_t>(kMostCloudPoints)) check_count(out.points.size() + 1, 0, 0, "points");
    out.points.push_back({v[0], v[1], v[2]});
    // Colours of 0-255 or 0-1 are seldom of unit length; normals always are.
    all_normals = all_normals && n == 6 && std::abs(std::hypot(v[3], v[4], v[5]) - 1) < 0.01f;
    if (all_normals) out.normals.push_back({v[3], v[4], v[5]});
  }
  if (!all_normals) out.normals.clear();
  return out;
}

}  // namespace booth::daemon

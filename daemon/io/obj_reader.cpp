// Wavefront OBJ: v, vn and f lines; everything else (materials, groups, texture) says nothing about a body and is passed over.
#include "daemon/io/cloud_readers.hpp"
#include "daemon/io/mesh_file.hpp"
#include "daemon/io/text_scanner.hpp"

namespace booth::daemon {
namespace {

std::array<float, 3> three_numbers(TextScanner& text) {
  std::array<float, 3> v{};
  for (float& x : v) {
    const std::string_view w = text.word();
    if (!parse_number(w, x)) throw ParseError(text.where() + ": '" + std::string(w.substr(0, 40)) + "' is not a number");
  }
  return v;
}

/// "7", "7/1", "7//3", "-1/..": the first number; counted from 1, or from the end when negative. Returned from 0; -1 when it names nothing.
std::int64_t corner(TextScanner& text, std::string_view word, std::size_t points) {
  std::int64_t index = 0;
  if (!parse_number(word.substr(0, word.find('/')), index))
    throw ParseError(text.where() + ": '" + std::string(word.substr(0, 40)) + "' is not a corner of a face");
  if (index > 0) return index - 1;
  if (index < 0 && static_cast<std::uint64_t>(-(index + 1)) < points) return static_cast<std::int64_t>(points) + index;
  return -1;
}

}  // namespace

RawCloud parse_obj(std::string_view bytes) {
  RawCloud out;
  TextScanner text(bytes);
  std::vector<std::int64_t> corners;
  while (text.next_line()) {
    const std::string_view key = text.word();
    if (key == "v") {
      if (out.points.size() == static_cast<std::size_t>(kMostCloudPoints)) check_count(out.points.size() + 1, 0, 0, "vertices");
      out.points.push_back(three_numbers(text));
    } else if (key == "vn") {
      out.normals.push_back(three_numbers(text));
    } else if (key == "f") {
      corners.clear();
      for (std::string_view w = text.word(); !w.empty(); w = text.word()) corners.push_back(corner(text, w, out.points.size()));
      append_polygon(corners, out.points.size(), text.where(), out.faces);
    }
  }
  // Normals have indices of their own in this format; only the common case of one per vertex, in the same order, is taken.
  if (out.normals.size() != out.points.size()) out.normals.clear();
  return out;
}

}  // namespace booth::daemon

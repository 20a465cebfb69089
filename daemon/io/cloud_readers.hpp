// What the parsers of single formats share; for mesh_file.cpp and the tests and fuzzers of each parser only.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace booth::daemon {

/// A file as it stands: own axes, own units, NaN points still in.
struct RawCloud {
  std::vector<std::array<float, 3>> points;
  std::vector<std::array<float, 3>> normals;  ///< empty, or one per point
  std::vector<std::array<std::int32_t, 3>> faces;
};

/// Thrown by the parsers; the caller puts the file's name before it.
struct ParseError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Each takes the whole file. Faces returned name existing points.
RawCloud parse_ply(std::string_view bytes);
RawCloud parse_obj(std::string_view bytes);
RawCloud parse_pcd(std::string_view bytes);
RawCloud parse_xyz(std::string_view bytes);

/// Refuses counts above kMostCloudPoints or above what `bytes_left` can hold at `least_bytes_each`; `what` names the things counted.
void check_count(std::uint64_t count, std::uint64_t least_bytes_each, std::uint64_t bytes_left, std::string_view what);

/// Cuts the polygon corners[0..n) into a fan after checking each against `points`; `where` is put into the error.
void append_polygon(const std::vector<std::int64_t>& corners, std::size_t points, std::string_view where, std::vector<std::array<std::int32_t, 3>>& faces);

}  // namespace booth::daemon

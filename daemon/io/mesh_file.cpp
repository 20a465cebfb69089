// What all cloud formats have in common once they are parsed: limits, points that are no numbers, units, axes; and the PLY writer.
#include "daemon/io/mesh_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "daemon/io/atomic_file.hpp"
#include "daemon/io/cloud_readers.hpp"
#include "daemon/io/file_bytes.hpp"

namespace booth::daemon {
namespace {

constexpr std::uint64_t kMostBytes = std::uint64_t{4} << 30;

std::string lower_extension(const std::filesystem::path& path) {
  std::string e = path.extension().string();
  std::transform(e.begin(), e.end(), e.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return e;
}

RawCloud parse(const std::filesystem::path& path) {
  using Parser = RawCloud (*)(std::string_view);
  const std::string e = lower_extension(path);
  const Parser parser = e == ".ply"                                 ? parse_ply
                        : e == ".obj"                               ? parse_obj
                        : e == ".pcd"                               ? parse_pcd
                        : e == ".xyz" || e == ".txt" || e == ".pts" ? parse_xyz
                                                                    : nullptr;
  if (parser == nullptr) throw ParseError("its extension is '" + e + "', known are .ply, .obj, .pcd, .xyz (.txt, .pts)");
  const std::string bytes = read_file_bytes(path, kMostBytes);
  if (bytes.empty()) throw ParseError("it is empty");
  return parser(bytes);
}

/// Side of the box that holds the middle 98 % of the points in each direction: a few stray points do not decide about units.
float robust_extent(const Eigen::Matrix3Xf& points) {
  float extent = 0;
  std::vector<float> values(static_cast<std::size_t>(points.cols()));
  for (int axis = 0; axis < 3; ++axis) {
    for (Eigen::Index i = 0; i < points.cols(); ++i) values[static_cast<std::size_t>(i)] = points(axis, i);
    const auto at = [&](double fraction) {
      const auto it = values.begin() + static_cast<std::ptrdiff_t>(std::lround(fraction * static_cast<double>(values.size() - 1)));
      std::nth_element(values.begin(), it, values.end());
      return *it;
    };
    const float high = at(0.99), low = at(0.01);
    extent = std::max(extent, high - low);
  }
  return extent;
}

std::string short_number(float x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", static_cast<double>(x));
  return text;
}

/// A stage is at most 20 m wide and a person at least 0.3 m high: read as metres, 20 to 500 can only be centimetres and 500 to 20,000 millimetres.
float metres_per_unit(float extent, Units units) {
  constexpr float kSmallest = 0.3f, kLargest = 20.0f, kCentimetresEnd = 500.0f, kMillimetresEnd = 20000.0f;
  const std::string measured = "the cloud is " + short_number(extent) + " units wide or high";
  float scale = units == Units::millimetres ? 0.001f : units == Units::centimetres ? 0.01f : 1.0f;
  if (extent > kLargest && extent <= kMillimetresEnd) {
    const bool centimetres = extent <= kCentimetresEnd;
    if (units == Units::automatic) scale = centimetres ? 0.01f : 0.001f;
    if (units == Units::metres)
      throw ParseError(measured + ", which can only be " + (centimetres ? "centimetres: give --units cm" : "millimetres: give --units mm") +
                       " (or --units auto)");
  }
  const float metres = extent * scale;
  if (metres > kLargest) throw ParseError(measured + ", which makes " + short_number(metres) + " m: larger than any stage; check --units");
  if (metres < kSmallest) throw ParseError(measured + ", which makes " + short_number(metres) + " m: too small for a person; check --units");
  return scale;
}

void append_floats(std::string& out, const float* values, std::size_t n) {
  char raw[3 * sizeof(float)];
  std::memcpy(raw, values, n * sizeof(float));
  out.append(raw, n * sizeof(float));
}

}  // namespace

std::optional<Units> units_from_name(std::string_view name) {
  if (name == "m") return Units::metres;
  if (name == "cm") return Units::centimetres;
  if (name == "mm") return Units::millimetres;
  if (name == "auto") return Units::automatic;
  return std::nullopt;
}

void check_count(std::uint64_t count, std::uint64_t least_bytes_each, std::uint64_t bytes_left, std::string_view what) {
  if (count > static_cast<std::uint64_t>(kMostCloudPoints))
    throw ParseError("it claims " + std::to_string(count) + " " + std::string(what) + ", at most " + std::to_string(kMostCloudPoints) + " are accepted");
  if (count * least_bytes_each > bytes_left)
    throw ParseError("it is truncated: it claims " + std::to_string(count) + " " + std::string(what) + ", and only " + std::to_string(bytes_left) +
                     " bytes follow");
}

void append_polygon(const std::vector<std::int64_t>& corners, std::size_t points, std::string_view where, std::vector<std::array<std::int32_t, 3>>& faces) {
  if (corners.size() < 3) throw ParseError(std::string(where) + " has fewer than three corners");
  for (const std::int64_t c : corners)
    if (c < 0 || static_cast<std::uint64_t>(c) >= points) throw ParseError(std::string(where) + " names a vertex that does not exist");
  if (faces.size() + corners.size() > 2 * static_cast<std::size_t>(kMostCloudPoints)) throw ParseError("it has too many faces");
  for (std::size_t i = 2; i < corners.size(); ++i)
    faces.push_back({static_cast<std::int32_t>(corners[0]), static_cast<std::int32_t>(corners[i - 1]), static_cast<std::int32_t>(corners[i])});
}

CloudFile read_cloud_file(const std::filesystem::path& path, const CloudReadOptions& options) {
  try {
    const RawCloud raw = parse(path);
    if (raw.points.empty()) throw ParseError("it has no points");
    constexpr float kBeyondAllUnits = 1e9f;  // larger coordinates would overflow the arithmetic behind
    const auto usable = [](const std::array<float, 3>& p) {
      return std::all_of(p.begin(), p.end(), [](float x) { return std::isfinite(x) && std::abs(x) < kBeyondAllUnits; });
    };
    std::vector<std::int32_t> kept(raw.points.size(), -1);
    std::int32_t n = 0;
    for (std::size_t i = 0; i < raw.points.size(); ++i)
      if (usable(raw.points[i])) kept[i] = n++;

    CloudFile out;
    out.dropped = static_cast<std::int64_t>(raw.points.size()) - n;
    if (n == 0) throw ParseError("none of its " + std::to_string(raw.points.size()) + " points is finite");
    Eigen::Matrix3Xf points(3, n), normals(3, raw.normals.empty() ? 0 : n);
    for (std::size_t i = 0; i < raw.points.size(); ++i) {
      if (kept[i] < 0) continue;
      points.col(kept[i]) = Eigen::Map<const Eigen::Vector3f>(raw.points[i].data());
      if (raw.normals.empty()) continue;
      const Eigen::Vector3f normal = Eigen::Map<const Eigen::Vector3f>(raw.normals[i].data());
      const float length = normal.norm();
      normals.col(kept[i]) = std::isfinite(length) && length > 1e-6f ? Eigen::Vector3f(normal / length) : Eigen::Vector3f(Eigen::Vector3f::Zero());
    }
    out.metres_per_unit = metres_per_unit(robust_extent(points), options.units);
    out.points = cmu_from_file(points, options.up) * out.metres_per_unit;
    out.normals = cmu_from_file(normals, options.up);

    std::vector<std::array<std::int32_t, 3>> faces;
    for (const auto& f : raw.faces) {
      const std::array<std::int32_t, 3> k{kept[static_cast<std::size_t>(f[0])], kept[static_cast<std::size_t>(f[1])], kept[static_cast<std::size_t>(f[2])]};
      if (k[0] >= 0 && k[1] >= 0 && k[2] >= 0) faces.push_back(k);
    }
    out.faces.resize(3, static_cast<Eigen::Index>(faces.size()));
    for (std::size_t i = 0; i < faces.size(); ++i) out.faces.col(static_cast<Eigen::Index>(i)) = Eigen::Map<const Eigen::Vector3i>(faces[i].data());
    return out;
  } catch (const ParseError& e) {
    throw std::runtime_error(path.string() + ": " + e.what());
  }
}

void write_ply(const FileTarget& target, const PlyMesh& mesh, UpAxis up, const std::string& comment) {
  const auto n = mesh.points.cols();
  if (mesh.normals != nullptr && mesh.normals->cols() != n) throw std::invalid_argument("write_ply: normals and points differ in number");
  if (mesh.colours != nullptr && mesh.colours->cols() != n) throw std::invalid_argument("write_ply: colours and points differ in number");
  if (comment.find('\n') != std::string::npos) throw std::invalid_argument("write_ply: the comment has more than one line");

  std::string header = "ply\nformat binary_little_endian 1.0\n";
  if (!comment.empty()) header += "comment " + comment + "\n";
  header += "comment metres, " + std::string(up == UpAxis::z ? "x forward, y left, z up" : "y up, z forward, x left") + "\n";
  header += "element vertex " + std::to_string(n) + "\nproperty float x\nproperty float y\nproperty float z\n";
  if (mesh.normals != nullptr) header += "property float nx\nproperty float ny\nproperty float nz\n";
  if (mesh.colours != nullptr) header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (mesh.faces != nullptr) header += "element face " + std::to_string(mesh.faces->cols()) + "\nproperty list uchar int vertex_indices\n";
  header += "end_header\n";

  const Eigen::Matrix3Xf points = file_from_cmu(mesh.points, up);
  Eigen::Matrix3Xf normals;
  if (mesh.normals != nullptr) normals = file_from_cmu(*mesh.normals, up);
  AtomicFile file(target);
  file.write(header);
  std::string row;
  for (Eigen::Index i = 0; i < n; ++i) {
    row.clear();
    append_floats(row, points.col(i).data(), 3);
    if (mesh.normals != nullptr) append_floats(row, normals.col(i).data(), 3);
    if (mesh.colours != nullptr) row.append(reinterpret_cast<const char*>(mesh.colours->col(i).data()), 3);
    file.write(row);
  }
  for (Eigen::Index i = 0; mesh.faces != nullptr && i < mesh.faces->cols(); ++i) {
    const Eigen::Vector3i f = mesh.faces->col(i);
    char raw[13] = {3};
    std::memcpy(raw + 1, f.data(), 12);
    file.write({raw, sizeof raw});
  }
  file.commit();
}

}  // namespace booth::daemon

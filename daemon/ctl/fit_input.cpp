// Meshes are sampled, normals are believed only when they agree with each other, and everything that was changed is said.
#include "daemon/ctl/fit_input.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "daemon/config/toml_document.hpp"
#include "daemon/io/file_bytes.hpp"
#include "fit/cloud/scan_floor.hpp"

namespace booth::daemon {
namespace {

constexpr int kMeshSamples = 60000;  // denser than four depth cameras see a person at 2.5 m
constexpr Eigen::Index kFewestPoints = 200;
constexpr std::uint64_t kMostTextBytes = 16 << 20;

/// Normals of a body point away from its middle on the whole: +1 when they do, -1 when all of them point inwards, 0 when they do not agree.
int orientation(const Eigen::Matrix3Xf& points, const Eigen::Matrix3Xf& normals) {
  const Eigen::Vector3d middle = points.cast<double>().rowwise().mean();
  double sum = 0, absolute = 0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const double outwards = normals.col(i).cast<double>().dot(points.col(i).cast<double>() - middle);
    sum += outwards, absolute += std::abs(outwards);
  }
  if (absolute == 0 || std::abs(sum) < 0.3 * absolute) return 0;
  return sum > 0 ? 1 : -1;
}

Eigen::Matrix3Xf joined(const Eigen::Matrix3Xf& a, const Eigen::Matrix3Xf& b) {
  Eigen::Matrix3Xf out(3, a.cols() + b.cols());
  out << a, b;
  return out;
}

/// Leaves what stands on the floor.
void take_out_floor(FitInput& input) {
  const fit::ScanFloor floor = fit::find_scan_floor(input.points);
  if (!floor.found) return;
  Eigen::Index kept = 0;
  for (Eigen::Index i = 0; i < input.points.cols(); ++i) {
    if (floor.above[static_cast<std::size_t>(i)] == 0) continue;
    input.points.col(kept) = input.points.col(i);
    if (input.normals.cols() > 0) input.normals.col(kept) = input.normals.col(i);
    ++kept;
  }
  input.floor_points = input.points.cols() - kept;
  input.points.conservativeResize(3, kept);
  if (input.normals.cols() > 0) input.normals.conservativeResize(3, kept);
  input.floor_known = true;
  input.floor_height = floor.height;
  input.notes.push_back(std::to_string(input.floor_points) + " points of the floor were taken out");
}

std::string place(const std::filesystem::path& path, const toml::node& node) { return path.string() + ":" + std::to_string(node.source().begin.line) + ": "; }

}  // namespace

void sample_surface(const Eigen::Matrix3Xf& vertices, const Eigen::Matrix3Xi& faces, int count, Eigen::Matrix3Xf& points, Eigen::Matrix3Xf& normals) {
  std::vector<double> end(static_cast<std::size_t>(faces.cols()));  // of each triangle on the line of summed areas
  double area = 0;
  for (Eigen::Index f = 0; f < faces.cols(); ++f) {
    const Eigen::Vector3d a = vertices.col(faces(0, f)).cast<double>();
    area += (vertices.col(faces(1, f)).cast<double>() - a).cross(vertices.col(faces(2, f)).cast<double>() - a).norm() / 2;
    end[static_cast<std::size_t>(f)] = area;
  }
  if (!(area > 0)) {
    points.resize(3, 0), normals.resize(3, 0);
    return;
  }
  points.resize(3, count), normals.resize(3, count);
  std::size_t f = 0;
  for (int i = 0; i < count; ++i) {
    while (end[f] < (i + 0.5) / count * area && f + 1 < end.size()) ++f;
    const auto t = faces.col(static_cast<Eigen::Index>(f));
    const Eigen::Vector3f a = vertices.col(t[0]), b = vertices.col(t[1]), c = vertices.col(t[2]);
    // The plastic number's sequence covers the unit square evenly for any number of points; folded, it covers the triangle.
    double u = std::fmod((i + 1) * 0.7548776662466927, 1.0), v = std::fmod((i + 1) * 0.5698402909980532, 1.0);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    points.col(i) = a + static_cast<float>(u) * (b - a) + static_cast<float>(v) * (c - a);
    normals.col(i) = (b - a).cross(c - a).normalized();
  }
}

FitInput read_fit_input(const std::vector<std::filesystem::path>& files, const CloudReadOptions& options) {
  FitInput out;
  bool every_normal = true;
  for (const auto& file : files) {
    CloudFile cloud = read_cloud_file(file, options);
    const std::string name = file.filename().string() + ": ";
    out.dropped += cloud.dropped;
    if (cloud.dropped > 0) out.notes.push_back(name + std::to_string(cloud.dropped) + " points are not finite and were left out");
    if (cloud.metres_per_unit != 1 && options.units == Units::automatic)
      out.notes.push_back(name + "taken as " + (cloud.metres_per_unit < 0.005f ? "millimetres" : "centimetres"));
    if (cloud.faces.cols() > 0) {
      Eigen::Matrix3Xf points, normals;
      sample_surface(cloud.points, cloud.faces, kMeshSamples, points, normals);
      if (points.cols() > 0) {
        cloud.points = std::move(points), cloud.normals = std::move(normals);
        out.notes.push_back(name + "mesh, replaced by " + std::to_string(kMeshSamples) + " points spread over its surface");
      }
    }
    if (cloud.normals.cols() > 0) {
      const int outwards = orientation(cloud.points, cloud.normals);
      if (outwards < 0) {
        cloud.normals = -cloud.normals;
        out.notes.push_back(name + "normals point inwards and were turned round");
      } else if (outwards == 0) {
        cloud.normals.resize(3, 0);
        out.notes.push_back(name + "normals contradict each other and were estimated anew");
      }
    }
    every_normal = every_normal && cloud.normals.cols() == cloud.points.cols();
    out.points = joined(out.points, cloud.points);
    out.normals = every_normal ? joined(out.normals, cloud.normals) : Eigen::Matrix3Xf(3, 0);
  }
  take_out_floor(out);
  if (out.points.cols() < kFewestPoints)
    throw std::runtime_error("the input has only " + std::to_string(out.points.cols()) + " points; a body needs at least " + std::to_string(kFewestPoints));
  return out;
}

std::vector<Eigen::Vector3f> read_viewpoints(const std::filesystem::path& calibration, UpAxis up) {
  const std::string text = read_file_bytes(calibration, kMostTextBytes);
  toml::table table;
  try {
    table = parse_toml(text, calibration.string());
  } catch (const toml::parse_error& e) {
    throw std::runtime_error(calibration.string() + ":" + std::to_string(e.source().begin.line) + ": " + std::string(e.description()));
  }
  const toml::array* cameras = table["camera"].as_array();
  if (cameras == nullptr || cameras->empty()) throw std::runtime_error(calibration.string() + ": it has no [[camera]] table");
  std::vector<Eigen::Vector3f> out;
  for (const toml::node& camera : *cameras) {
    const toml::table* entries = camera.as_table();
    const toml::node* matrix = entries == nullptr ? nullptr : entries->get("camera_to_world");
    if (matrix == nullptr) throw std::runtime_error(place(calibration, camera) + "camera_to_world is missing; it is a 4x4 matrix, metres");
    Eigen::Vector3f centre;
    for (std::size_t row = 0; row < 3; ++row) {
      const toml::array* rows = matrix->as_array();
      const toml::array* numbers = rows == nullptr || rows->size() != 4 ? nullptr : (*rows)[row].as_array();
      const auto value = numbers == nullptr || numbers->size() != 4 ? std::nullopt : (*numbers)[3].value<double>();
      if (!value || !std::isfinite(*value) || std::abs(*value) > 1000)
        throw std::runtime_error(place(calibration, *matrix) + "camera_to_world must have four rows of four numbers, the camera within 1000 m");
      centre[static_cast<Eigen::Index>(row)] = static_cast<float>(*value);
    }
    out.push_back(cmu_from_file(centre, up).col(0));
  }
  return out;
}

fit::PoseVector read_initial_pose(const std::filesystem::path& path) {
  const std::string text = read_file_bytes(path, kMostTextBytes);
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (json.is_discarded()) throw std::runtime_error(path.string() + ": it is not JSON");
  const nlohmann::json* q = json.is_object() && json.contains("q") ? &json["q"] : &json;
  if (!q->is_array() || q->size() != fit::kDofs)
    throw std::runtime_error(path.string() + ": an initial pose is an array of 36 numbers, or an object that has one as \"q\"");
  fit::PoseVector out;
  for (int d = 0; d < fit::kDofs; ++d) {
    const auto& value = (*q)[static_cast<std::size_t>(d)];
    constexpr double kMost = 1000;  // metres or radians: anything larger is another format
    if (!value.is_number() || std::abs(value.get<double>()) > kMost)
      throw std::runtime_error(path.string() + ": q[" + std::to_string(d) + "] (" + std::string(fit::dof_name(d)) + ") is not a number of metres or radians");
    out[d] = value.get<double>();
  }
  return out;
}

}  // namespace booth::daemon

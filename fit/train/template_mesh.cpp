// Visibility from outside, the half surface, its remeshing and its mirror image.
#include "fit/train/template_mesh.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <stdexcept>

#include "fit/train/surface.hpp"

namespace booth::fit::train {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

using Triangle = std::array<int, 3>;

/// The diagonal is the shorter one; for mirrored quads it is the mirrored one.
std::array<Triangle, 2> cut(const std::array<int, 4>& q, const Eigen::Matrix3Xd& p) {
  if ((p.col(q[0]) - p.col(q[2])).norm() <= (p.col(q[1]) - p.col(q[3])).norm()) return {{{q[0], q[1], q[2]}, {q[0], q[2], q[3]}}};
  return {{{q[0], q[1], q[3]}, {q[1], q[2], q[3]}}};
}

/// Nearest-surface image along one direction; draws triangles and keeps the quad that each pixel shows.
class DepthBuffer {
 public:
  DepthBuffer(const Eigen::Vector3d& direction, double pixel, double radius) : pixel_(pixel), half_(static_cast<int>(radius / pixel) + 2) {
    const Eigen::Vector3d helper = std::abs(direction.y()) < 0.9 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitX();
    axes_.row(0) = helper.cross(direction).normalized();
    axes_.row(1) = direction.cross(axes_.row(0).transpose());
    axes_.row(2) = direction;
    depth_.assign(at(4 * half_ * half_), -1e9f);
    owner_.assign(depth_.size(), -1);
  }
  Eigen::Matrix3Xd project(const Eigen::Matrix3Xd& points) const { return axes_ * points; }
  void draw(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c, int owner) {
    const double area = (b - a).head<2>().x() * (c - a).y() - (b - a).y() * (c - a).x();
    if (std::abs(area) < 1e-14) return;
    const auto pixel_of = [&](double v) { return static_cast<int>(std::floor(v / pixel_)) + half_; };
    const int x0 = pixel_of(std::min({a.x(), b.x(), c.x()})), x1 = pixel_of(std::max({a.x(), b.x(), c.x()}));
    const int y0 = pixel_of(std::min({a.y(), b.y(), c.y()})), y1 = pixel_of(std::max({a.y(), b.y(), c.y()}));
    for (int y = std::max(0, y0); y <= std::min(2 * half_ - 1, y1); ++y)
      for (int x = std::max(0, x0); x <= std::min(2 * half_ - 1, x1); ++x) {
        const double px = (x - half_ + 0.5) * pixel_, py = (y - half_ + 0.5) * pixel_;
        const double v = ((px - a.x()) * (c.y() - a.y()) - (py - a.y()) * (c.x() - a.x())) / area;
        const double w = ((b.x() - a.x()) * (py - a.y()) - (b.y() - a.y()) * (px - a.x())) / area;
        if (v < 0 || w < 0 || v + w > 1) continue;
        const float z = static_cast<float>(a.z() + v * (b.z() - a.z()) + w * (c.z() - a.z()));
        const std::size_t i = at(y * 2 * half_ + x);
        if (z > depth_[i]) {
          depth_[i] = z;
          owner_[i] = owner;
        }
      }
  }
  const std::vector<int>& owner() const { return owner_; }

 private:
  double pixel_;
  int half_;
  Eigen::Matrix3d axes_;
  std::vector<float> depth_;
  std::vector<int> owner_;
};

}  // namespace

std::vector<int> count_views(const BaseBody& base, const Eigen::Matrix3Xd& positions, int directions, double pixel) {
  const Eigen::Vector3d low = positions.leftCols(base.skin_vertices).rowwise().minCoeff(), high = positions.leftCols(base.skin_vertices).rowwise().maxCoeff();
  const Eigen::Matrix3Xd centred = positions.colwise() - (low + high) / 2;
  std::vector<int> views(base.quads.size(), 0), last(base.quads.size(), -1);
  for (int d = 0; d < directions; ++d) {
    const double y = 1 - (2 * d + 1.0) / directions, turn = d * 2.399963229728653;  // the golden angle spreads them evenly
    const Eigen::Vector3d direction(std::sqrt(1 - y * y) * std::cos(turn), y, std::sqrt(1 - y * y) * std::sin(turn));
    DepthBuffer buffer(direction, pixel, (high - low).norm() / 2);
    const Eigen::Matrix3Xd p = buffer.project(centred);
    const auto draw = [&](const std::vector<std::array<int, 4>>& quads, int first_owner, int step) {
      for (std::size_t i = 0; i < quads.size(); ++i)
        for (const auto& t : cut(quads[i], positions)) buffer.draw(p.col(t[0]), p.col(t[1]), p.col(t[2]), first_owner + step * static_cast<int>(i));
    };
    draw(base.quads, 0, 1);
    draw(base.occluder_quads, -1, 0);
    for (int owner : buffer.owner())
      if (owner >= 0 && last[at(owner)] != d) {
        last[at(owner)] = d;
        ++views[at(owner)];
      }
  }
  return views;
}

Vertices TemplateMesh::apply(const Eigen::Matrix3Xd& base_vertices) const {
  Vertices out(3, vertex_count());
  for (int v = 0; v < vertex_count(); ++v) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const auto& [i, w] : rows[at(v)]) sum += w * base_vertices.col(i);
    out.col(v) = sum.cast<float>();
  }
  return out;
}

TemplateMesh make_template(const BaseBody& base, const Eigen::Matrix3Xd& positions, double edge_length) {
  // The mirror image of every base vertex.
  std::map<std::array<long, 3>, int> by_place;
  const auto key = [&](const Eigen::Vector3d& p) { return std::array<long, 3>{std::lround(p.x() * 1e6), std::lround(p.y() * 1e6), std::lround(p.z() * 1e6)}; };
  for (int v = 0; v < base.skin_vertices; ++v) by_place[key(base.vertices.col(v))] = v;
  std::vector<int> mirrored(at(base.skin_vertices));
  for (int v = 0; v < base.skin_vertices; ++v) {
    const Eigen::Vector3d p = base.vertices.col(v);
    const auto found = by_place.find(key({-p.x(), p.y(), p.z()}));
    if (found == by_place.end()) throw std::invalid_argument("template: base vertex " + std::to_string(v) + " has no mirror image");
    mirrored[at(v)] = found->second;
  }

  // Half of the skin, seen from outside or not.
  const auto views = count_views(base, positions, 96, 0.002);
  std::vector<char> seen(at(base.skin_vertices), 0);
  std::vector<std::array<int, 3>> half;
  std::vector<Eigen::Vector3d> points(at(base.skin_vertices));
  std::vector<char> midline(at(base.skin_vertices), 0);
  for (int v = 0; v < base.skin_vertices; ++v) {
    points[at(v)] = positions.col(v);
    if (mirrored[at(v)] == v) midline[at(v)] = 1, points[at(v)].x() = 0;
  }
  for (std::size_t i = 0; i < base.quads.size(); ++i) {
    const auto& q = base.quads[i];
    if (views[i] >= 2)
      for (int v : q) seen[at(v)] = seen[at(mirrored[at(v)])] = 1;
    double x = 0;
    for (int v : q) x += base.vertices(0, v);
    if (x > 0)
      for (const auto& t : cut(q, positions)) half.push_back(t);
  }
  std::vector<char> inner(seen.size());
  for (std::size_t v = 0; v < seen.size(); ++v) inner[v] = !seen[v];

  Surface surface(std::move(points), std::move(half), std::move(midline));
  surface.remove_vertices(inner);
  surface.remesh(edge_length, 8);

  // Both halves: the left one as it is, then the mirror images of what does not lie on the midline.
  TemplateMesh mesh;
  std::vector<int> left(at(surface.vertex_count()), -1), right;
  std::vector<int> mirror;
  for (int v = 0; v < surface.vertex_count(); ++v) {
    if (!surface.alive(v)) continue;
    SparseRow row = surface.row(v);
    if (surface.midline(v)) {  // symmetric for asymmetric bodies too
      std::map<int, float> sum;
      for (const auto& [i, w] : row) sum[i] += w / 2, sum[mirrored[at(i)]] += w / 2;
      row.assign(sum.begin(), sum.end());
    }
    left[at(v)] = mesh.vertex_count();
    mesh.rows.push_back(row);
  }
  right = left;
  mirror.resize(mesh.rows.size());
  std::iota(mirror.begin(), mirror.end(), 0);
  for (int v = 0; v < surface.vertex_count(); ++v) {
    if (!surface.alive(v) || surface.midline(v)) continue;
    right[at(v)] = mesh.vertex_count();
    mirror[at(left[at(v)])] = right[at(v)];
    mirror.push_back(left[at(v)]);
    SparseRow row = surface.row(v);
    for (auto& entry : row) entry.first = mirrored[at(entry.first)];
    mesh.rows.push_back(row);
  }
  mesh.mirror_vertex = Eigen::Map<Eigen::VectorXi>(mirror.data(), static_cast<Eigen::Index>(mirror.size()));
  const auto faces = surface.faces();
  mesh.faces.resize(3, static_cast<Eigen::Index>(2 * faces.size()));
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const auto [a, b, c] = faces[f];
    mesh.faces.col(static_cast<Eigen::Index>(f)) = Eigen::Vector3i(left[at(a)], left[at(b)], left[at(c)]);
    mesh.faces.col(static_cast<Eigen::Index>(faces.size() + f)) = Eigen::Vector3i(right[at(a)], right[at(c)], right[at(b)]);
  }
  mesh.average = mesh.apply(positions);
  return mesh;
}

MeshReport inspect(const Vertices& vertices, const Faces& faces) {
  MeshReport report;
  std::map<std::pair<int, int>, int> uses;
  std::vector<int> parent(static_cast<std::size_t>(vertices.cols()));
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int v) {
    while (parent[at(v)] != v) v = parent[at(v)] = parent[at(parent[at(v)])];
    return v;
  };
  for (Eigen::Index f = 0; f < faces.cols(); ++f)
    for (int i = 0; i < 3; ++i) {
      const int a = faces(i, f), b = faces((i + 1) % 3, f);
      ++uses[{std::min(a, b), std::max(a, b)}];
      parent[at(root(a))] = root(b);
    }
  std::vector<double> lengths;
  for (const auto& [edge, count] : uses) {
    report.open_edges += count == 1;
    report.overused_edges += count > 2;
    lengths.push_back((vertices.col(edge.first) - vertices.col(edge.second)).norm());
  }
  report.vertices = static_cast<int>(vertices.cols());
  report.edges = static_cast<int>(uses.size());
  report.faces = static_cast<int>(faces.cols());
  for (int v = 0; v < report.vertices; ++v) report.components += root(v) == v;
  if (lengths.empty()) return report;
  std::sort(lengths.begin(), lengths.end());
  report.edge_mean = std::accumulate(lengths.begin(), lengths.end(), 0.0) / static_cast<double>(lengths.size());
  report.edge_p05 = lengths[lengths.size() / 20];
  report.edge_p95 = lengths[lengths.size() - 1 - lengths.size() / 20];
  return report;
}

}  // namespace booth::fit::train

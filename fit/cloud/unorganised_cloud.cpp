// Clouds that no image orders: thins them evenly, finds what hangs together, and gives them normals that point out of the body.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "fit/cloud/cloud_builder.hpp"

namespace booth::fit {
namespace {

using Points = std::vector<Eigen::Vector3f>;
using Index = std::uint32_t;

/// Points sorted by the cells of a uniform grid; cells are found by binary search, so that the memory goes with the points and not with the space.
class SortedGrid {
 public:
  SortedGrid(const Points& points, float cell) : points_(points), inverse_(1 / cell), radius_(cell) {
    low_ = points.front();
    Eigen::Vector3f high = low_;
    for (const auto& p : points) low_ = low_.cwiseMin(p), high = high.cwiseMax(p);
    for (int k = 0; k < 3; ++k) size_[k] = static_cast<std::int64_t>((high[k] - low_[k]) * inverse_) + 3;
    entries_.reserve(points.size());
    for (Index i = 0; i < points.size(); ++i) entries_.push_back({key(cell_of(points[i])), i});
    std::sort(entries_.begin(), entries_.end());
  }

  /// Calls f(index) for every point of each occupied cell: f(first entry, one past the last).
  template <typename F>
  void each_cell(F f) const {
    for (std::size_t a = 0, b; a < entries_.size(); a = b) {
      for (b = a + 1; b < entries_.size() && entries_[b].key == entries_[a].key; ++b) {
      }
      f(a, b);
    }
  }
  std::size_t cells() const {
    std::size_t n = 0;
    each_cell([&](std::size_t, std::size_t) { ++n; });
    return n;
  }
  Index at(std::size_t entry) const { return entries_[entry].index; }
  /// Of the cell that holds p.
  Eigen::Vector3f cell_centre(const Eigen::Vector3f& p) const {
    const auto c = cell_of(p);
    return low_ + Eigen::Vector3f(static_cast<float>(c[0]) - 0.5f, static_cast<float>(c[1]) - 0.5f, static_cast<float>(c[2]) - 0.5f) * radius_;
  }

  /// Calls f(index) for every point nearer to p than one cell, in a fixed order.
  template <typename F>
  void around(const Eigen::Vector3f& p, F f) const {
    const auto c = cell_of(p);
    for (std::int64_t z = c[2] - 1; z <= c[2] + 1; ++z)
      for (std::int64_t y = c[1] - 1; y <= c[1] + 1; ++y) {
        const std::int64_t last = key({c[0] + 1, y, z});
        for (auto e = std::lower_bound(entries_.begin(), entries_.end(), Entry{key({c[0] - 1, y, z}), 0}); e != entries_.end() && e->key <= last; ++e)
          if ((points_[e->index] - p).squaredNorm() < radius_ * radius_) f(e->index);
      }
  }

 private:
  struct Entry {
    std::int64_t key;
    Index index;
    bool operator<(const Entry& o) const { return key != o.key ? key < o.key : index < o.index; }
  };
  using Cell = std::array<std::int64_t, 3>;
  Cell cell_of(const Eigen::Vector3f& p) const {  // from 1 on, so that neighbours never wrap
    return {static_cast<std::int64_t>((p.x() - low_.x()) * inverse_) + 1, static_cast<std::int64_t>((p.y() - low_.y()) * inverse_) + 1,
            static_cast<std::int64_t>((p.z() - low_.z()) * inverse_) + 1};
  }
  std::int64_t key(const Cell& c) const { return (c[2] * size_[1] + c[1]) * size_[0] + c[0]; }

  const Points& points_;
  float inverse_, radius_;
  Eigen::Vector3f low_;
  std::int64_t size_[3];
  std::vector<Entry> entries_;
};

/// Union-find in which each member also knows whether it is turned against its root.
class SignedSets {
 public:
  explicit SignedSets(std::size_t n) : parent_(n), against_(n, 0) { std::iota(parent_.begin(), parent_.end(), 0); }
  struct Root {
    Index set;
    bool against;
  };
  Root find(Index i) {
    Index root = i;
    bool against = false;
    while (parent_[root] != root) against ^= against_[root] != 0, root = parent_[root];
    for (bool a = against; parent_[i] != root && i != root;) {  // the second walk shortens the way for the next
      const Index up = parent_[i];
      const bool step = against_[i] != 0;
      parent_[i] = root, against_[i] = a;
      a ^= step;
      i = up;
    }
    return {root, against};
  }
  void unite(Index a, Index b, bool opposed) {
    const Root ra = find(a), rb = find(b);
    if (ra.set == rb.set) return;
    const Index low = std::min(ra.set, rb.set), high = std::max(ra.set, rb.set);
    parent_[high] = low;
    against_[high] = ra.against ^ rb.against ^ opposed;
  }

 private:
  std::vector<Index> parent_;
  std::vector<std::uint8_t> against_;
};

/// Which cells of a coarse grid the outside reaches without crossing the cloud.
class Outside {
 public:
  Outside(const Points& points, float cell) {
    low_ = points.front();
    Eigen::Vector3f high = low_;
    for (const auto& p : points) low_ = low_.cwiseMin(p), high = high.cwiseMax(p);
    const Eigen::Vector3f extent = high - low_;
    const auto cells = [&](float c) { return (extent.x() / c + 5.0) * (extent.y() / c + 5.0) * (extent.z() / c + 5.0); };
    while (cells(cell) > 8e6) cell *= 1.25f;
    cell_ = cell;
    for (int k = 0; k < 3; ++k) n_[k] = static_cast<int>(extent[k] / cell) + 5;
    low_ -= Eigen::Vector3f::Constant(2 * cell);
    state_.assign(static_cast<std::size_t>(n_[0]) * static_cast<std::size_t>(n_[1]) * static_cast<std::size_t>(n_[2]), kInside);
    for (const auto& p : points) state_[static_cast<std::size_t>(index(p))] = kSurface;
    std::vector<int> front{0};
    state_[0] = kOutside;
    const int steps[3] = {1, n_[0], n_[0] * n_[1]};
    while (!front.empty()) {
      const int i = front.back();
      front.pop_back();
      const int at[3] = {i % n_[0], i / n_[0] % n_[1], i / n_[0] / n_[1]};
      for (int k = 0; k < 3; ++k)
        for (const int d : {-1, 1}) {
          if (at[k] + d < 0 || at[k] + d >= n_[k]) continue;
          auto& s = state_[static_cast<std::size_t>(i + d * steps[k])];
          if (s == kInside) s = kOutside, front.push_back(i + d * steps[k]);
        }
    }
  }
  float cell() const { return cell_; }
  bool contains(const Eigen::Vector3f& p) const {
    const Eigen::Vector3f local = (p - low_) / cell_;
    for (int k = 0; k < 3; ++k)
      if (!(local[k] >= 0 && local[k] < static_cast<float>(n_[k]))) return true;
    return state_[static_cast<std::size_t>(index(p))] == kOutside;
  }

 private:
  enum : std::uint8_t { kInside, kSurface, kOutside };
  int index(const Eigen::Vector3f& p) const {
    const Eigen::Vector3f local = (p - low_) / cell_;
    const auto at = [&](int k) { return std::min(static_cast<int>(local[k]), n_[k] - 1); };
    return (at(2) * n_[1] + at(1)) * n_[0] + at(0);
  }
  Eigen::Vector3f low_;
  float cell_ = 1;
  int n_[3];
  std::vector<std::uint8_t> state_;
};

bool usable(const Eigen::Vector3f& p) { return p.cwiseAbs().maxCoeff() < 1000; }  // false for NaN; beyond a kilometre is no person

template <typename T>
void keep(std::vector<T>& values, const std::vector<Index>& chosen) {
  if (values.empty()) return;
  std::vector<T> out;
  out.reserve(chosen.size());
  for (const Index i : chosen) out.push_back(values[i]);
  values = std::move(out);
}

/// About how far neighbouring points of a surface are apart: from the first grid, of ever larger cells, whose cells hold four points on average.
float spacing(const Points& points) {
  Eigen::Vector3f low = points.front(), high = low;
  for (const auto& p : points) low = low.cwiseMin(p), high = high.cwiseMax(p);
  const auto n = static_cast<float>(points.size());
  for (float cell = std::max(0.005f, (high - low).maxCoeff() / 1e5f);; cell *= 2) {
    const auto cells = static_cast<float>(SortedGrid(points, cell).cells());
    if (cells * 4 <= n || cells <= 8) return cell * std::sqrt(cells / n);
  }
}

/// One point for each cell, the one nearest the cell's centre, in cells as small as the capacity allows.
std::vector<Index> thin(const Points& points, std::size_t capacity) {
  for (float cell = std::max(0.9f * spacing(points) * std::sqrt(static_cast<float>(points.size()) / static_cast<float>(capacity)), 1e-4f);; cell *= 1.1f) {
    const SortedGrid grid(points, cell);
    if (grid.cells() > capacity) continue;
    std::vector<Index> chosen;
    grid.each_cell([&](std::size_t a, std::size_t b) {
      const Eigen::Vector3f centre = grid.cell_centre(points[grid.at(a)]);
      std::size_t best = a;
      for (std::size_t e = a + 1; e < b; ++e)
        if ((points[grid.at(e)] - centre).squaredNorm() < (points[grid.at(best)] - centre).squaredNorm()) best = e;
      chosen.push_back(grid.at(best));
    });
    return chosen;
  }
}

std::vector<Index> largest_piece(const Points& points, float gap) {
  const SortedGrid grid(points, gap);
  SignedSets sets(points.size());
  for (Index i = 0; i < points.size(); ++i)
    grid.around(points[i], [&](Index j) {
      if (j < i) sets.unite(i, j, false);
    });
  std::vector<Index> size(points.size(), 0);
  for (Index i = 0; i < points.size(); ++i) ++size[sets.find(i).set];
  const auto largest = static_cast<Index>(std::max_element(size.begin(), size.end()) - size.begin());
  std::vector<Index> chosen;
  for (Index i = 0; i < points.size(); ++i)
    if (sets.find(i).set == largest) chosen.push_back(i);
  return chosen;
}

/// The direction in which the neighbourhood is thinnest; its sign is open. Zero where there are too few neighbours.
Eigen::Vector3f plane_normal(const Points& points, const SortedGrid& grid, Index i) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  int n = 0;
  grid.around(points[i], [&](Index j) {
    const Eigen::Vector3d d = (points[j] - points[i]).cast<double>();
    sum += d;
    squares += d * d.transpose();
    ++n;
  });
  if (n < 6) return Eigen::Vector3f::Zero();
  const Eigen::Matrix3d covariance = squares / n - sum * sum.transpose() / (static_cast<double>(n) * n);
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(covariance);
  if (!(solver.eigenvalues()[1] > 1e-4 * solver.eigenvalues()[2])) return Eigen::Vector3f::Zero();  // a thread of points
  return solver.eigenvectors().col(0).cast<float>();
}

/// Gives neighbouring normals one sense, patch by patch, and then lets each patch vote which sense is outwards.
void turn_outwards(const Points& points, Points& normals, const SortedGrid& grid, float step, std::span<const Eigen::Vector3f> viewpoints) {
  SignedSets patches(points.size());
  // The flattest joints first, so that a patch grows around edges and not over them.
  for (const float flat : {0.98f, 0.93f, 0.8f})
    for (Index i = 0; i < points.size(); ++i)
      grid.around(points[i], [&](Index j) {
        const float cosine = normals[i].dot(normals[j]);
        if (j < i && std::abs(cosine) > flat) patches.unite(i, j, cosine < 0);
      });

  const Outside outside(points, std::max(1.5f * step, 0.025f));
  // Middle of the body at each height, for clouds that are open and that nobody says the viewpoint of.
  constexpr float kSlice = 0.2f;
  Eigen::Vector3f low = points.front(), high = low;
  for (const auto& p : points) low = low.cwiseMin(p), high = high.cwiseMax(p);
  std::vector<Eigen::Vector4d> slices(std::min<std::size_t>(static_cast<std::size_t>((high.y() - low.y()) / kSlice) + 1, 10000), Eigen::Vector4d::Zero());
  const auto slice_of = [&](const Eigen::Vector3f& p) -> Eigen::Vector4d& {
    return slices[std::min(static_cast<std::size_t>((p.y() - low.y()) / kSlice), slices.size() - 1)];
  };
  for (const auto& p : points) slice_of(p) += Eigen::Vector4d(p.x(), p.y(), p.z(), 1);

  struct Votes {
    int points = 0, closed = 0;
    double view = 0, axis = 0;
  };
  std::vector<Votes> votes(points.size());
  for (Index i = 0; i < points.size(); ++i) {
    if (normals[i].isZero()) continue;
    const auto [set, against] = patches.find(i);
    Votes& v = votes[set];
    const Eigen::Vector3f p = points[i], n = against ? Eigen::Vector3f(-normals[i]) : normals[i];
    ++v.points;
    for (const float s : {1.3f, 2.0f}) v.closed += outside.contains(p + s * outside.cell() * n) - outside.contains(p - s * outside.cell() * n);
    const Eigen::Vector3f* nearest = nullptr;
    for (const auto& view : viewpoints)
      if (view.allFinite() && (!nearest || (view - p).squaredNorm() < (*nearest - p).squaredNorm())) nearest = &view;
    if (nearest) v.view += n.dot((*nearest - p).normalized());
    const Eigen::Vector4d& slice = slice_of(p);
    v.axis += n.dot(p - (slice.head<3>() / slice[3]).cast<float>());
  }
  for (Index i = 0; i < points.size(); ++i) {
    const auto [set, against] = patches.find(i);
    const Votes& v = votes[set];
    const bool closed_says = std::abs(v.closed) > 0.2 * v.points;
    const bool inwards = closed_says ? v.closed < 0 : v.view != 0 ? v.view < 0 : v.axis < 0;
    if (against != inwards) normals[i] = -normals[i];
  }
}

}  // namespace

bool build_unorganised(const Eigen::Matrix3Xf& points, const Eigen::Matrix3Xf& normals, std::span<const Eigen::Vector3f> viewpoints,
                       const UnorganisedSettings& settings, Observation& out, CloudReport& report) {
  if (normals.cols() != 0 && normals.cols() != points.cols())
    throw std::invalid_argument("cloud: " + std::to_string(points.cols()) + " points and " + std::to_string(normals.cols()) +
                                " normals; give as many, or none");
  if (!(settings.component_gap > 0 && settings.component_gap < 10)) throw std::invalid_argument("cloud: component_gap must be above 0 and below 10 m");
  report = {};
  out.cloud.clear();
  out.views.clear();
  out.floor_known = false;
  out.floor_height = 0;
  report.frames = 1;

  Points p, n;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    if (!usable(points.col(i))) continue;
    p.emplace_back(points.col(i));
    if (normals.cols() != 0) n.emplace_back(normals.col(i));
  }
  report.raw = static_cast<int>(p.size());
  if (p.empty() || out.cloud.capacity() == 0) {
    report.outcome = CloudOutcome::no_measurement;
    return false;
  }
  if (const auto capacity = static_cast<std::size_t>(out.cloud.capacity()); p.size() > capacity) {
    const std::vector<Index> chosen = thin(p, capacity);
    keep(p, chosen), keep(n, chosen);
  }
  const auto thinned = p.size();
  if (settings.largest_component) {
    const std::vector<Index> chosen = largest_piece(p, settings.component_gap);
    keep(p, chosen), keep(n, chosen);
  }
  if (normals.cols() == 0) {
    const float step = spacing(p);
    const SortedGrid grid(p, std::clamp(2 * step, 0.02f, 0.1f));
    n.resize(p.size());
    for (Index i = 0; i < p.size(); ++i) n[i] = plane_normal(p, grid, i);
    turn_outwards(p, n, grid, step, viewpoints);
  }
  for (std::size_t i = 0; i < p.size(); ++i) {
    const float length = n[i].norm();
    out.cloud.push(p[i], std::isfinite(length) && length > 1e-6f ? Eigen::Vector3f(n[i] / length) : Eigen::Vector3f::Zero(), 0);
  }
  report.points = out.cloud.size;
  report.other = static_cast<int>(static_cast<std::int64_t>(report.raw) * static_cast<std::int64_t>(thinned - p.size()) / static_cast<std::int64_t>(thinned));
  report.person = report.raw - report.other;
  report.persons = 1;
  report.outcome = CloudOutcome::person;
  return true;
}

}  // namespace booth::fit

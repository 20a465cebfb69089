// Clouds that no image orders: thins them evenly, finds what hangs together, and gives them normals that point out of the body.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "fit/cloud/cloud_builder.hpp"
#include "fit/cloud/exterior_view.hpp"

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

/// Space around a cloud whose points are swollen to balls: what the outside reaches, and the largest hollow that it does not.
class Enclosure {
 public:
  enum Kind : std::uint8_t { kHollow, kSurface, kOutside, kBody };

  /// The balls' radius closes gaps between points twice as wide.
  Enclosure(const Points& points, float radius) {
    low_ = points.front();
    Eigen::Vector3f high = low_;
    for (const auto& p : points) low_ = low_.cwiseMin(p), high = high.cwiseMax(p);
    const Eigen::Vector3f extent = high - low_;
    constexpr int kBall = 2, kMargin = kBall + 2;  // cells
    float cell = radius / kBall;
    const auto cells = [&](float c) {
      constexpr double kEdges = 2 * kMargin + 1;
      return (extent.x() / c + kEdges) * (extent.y() / c + kEdges) * (extent.z() / c + kEdges);
    };
    while (cells(cell) > 8e6) cell *= 1.25f;
    cell_ = cell;
    radius_ = kBall * cell;
    for (int k = 0; k < 3; ++k) n_[k] = static_cast<int>(extent[k] / cell) + 2 * kMargin + 1;
    low_ -= Eigen::Vector3f::Constant(kMargin * cell);
    state_.assign(static_cast<std::size_t>(n_[0]) * static_cast<std::size_t>(n_[1]) * static_cast<std::size_t>(n_[2]), kHollow);
    for (const auto& p : points) {
      const Eigen::Vector3f local = (p - low_) / cell_;
      const int at[3] = {static_cast<int>(local.x()), static_cast<int>(local.y()), static_cast<int>(local.z())};
      for (int z = at[2] - kBall; z <= at[2] + kBall; ++z)
        for (int y = at[1] - kBall; y <= at[1] + kBall; ++y)
          for (int x = at[0] - kBall; x <= at[0] + kBall; ++x) {
            const Eigen::Vector3f centre(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f, static_cast<float>(z) + 0.5f);
            if ((centre - local).squaredNorm() < kBall * kBall) state_[static_cast<std::size_t>((z * n_[1] + y) * n_[0] + x)] = kSurface;
          }
    }
    flood(0, kHollow, kOutside);
    std::size_t largest = 0;
    int seed = -1;
    constexpr Kind kSeen = static_cast<Kind>(kBody + 1);
    for (std::size_t i = 0; i < state_.size(); ++i)
      if (state_[i] == kHollow)
        if (const std::size_t size = flood(static_cast<int>(i), kHollow, kSeen); size > largest) largest = size, seed = static_cast<int>(i);
    if (seed >= 0) flood(seed, kSeen, kBody);
    for (auto& s : state_)
      if (s == kSeen) s = kHollow;
  }
  float cell() const { return cell_; }
  float radius() const { return radius_; }
  Kind at(const Eigen::Vector3f& p) const {
    const Eigen::Vector3f local = (p - low_) / cell_;
    for (int k = 0; k < 3; ++k)
      if (!(local[k] >= 0 && local[k] < static_cast<float>(n_[k]))) return kOutside;
    return static_cast<Kind>(
        state_[static_cast<std::size_t>((static_cast<int>(local.z()) * n_[1] + static_cast<int>(local.y())) * n_[0] + static_cast<int>(local.x()))]);
  }

 private:
  /// Number of cells changed.
  std::size_t flood(int seed, Kind from, Kind to) {
    std::size_t changed = 1;
    front_.assign(1, seed);
    state_[static_cast<std::size_t>(seed)] = to;
    const int steps[3] = {1, n_[0], n_[0] * n_[1]};
    while (!front_.empty()) {
      const int i = front_.back();
      front_.pop_back();
      const int at[3] = {i % n_[0], i / n_[0] % n_[1], i / n_[0] / n_[1]};
      for (int k = 0; k < 3; ++k)
        for (const int d : {-1, 1}) {
          if (at[k] + d < 0 || at[k] + d >= n_[k]) continue;
          auto& s = state_[static_cast<std::size_t>(i + d * steps[k])];
          if (s == from) s = to, front_.push_back(i + d * steps[k]), ++changed;
        }
    }
    return changed;
  }
  Eigen::Vector3f low_;
  float cell_ = 1, radius_ = 1;
  int n_[3];
  std::vector<std::uint8_t> state_;
  std::vector<int> front_;
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

/// What speaks for each normal's present sense, from -1 (turn it) to 1: the body's hollow behind it, or the outside nearer before it than behind it.
/// Empty where the cloud does not enclose a body. Points with the hollow on both sides, such as those of a hand sunk into the trunk, lose their
/// normal: no body has a surface there.
std::vector<float> enclosure_votes(const Points& points, Points& normals, float step) {
  constexpr float kReach = 0.12f;    // m; thicker than any limb whose hollow the balls fill
  constexpr float kBehind = 0.015f;  // m; the hollow begins where the balls end, if the normal is about right
  std::vector<float> votes(points.size());
  std::vector<Index> buried;
  // Gaps of an uneven cloud let the outside in; wider balls close them, at the price of what lies between an arm and the trunk.
  for (const float swell : {2.2f, 3.0f, 4.0f}) {
    const Enclosure space(points, std::max(swell * step, 0.012f));
    const float stride = 0.5f * space.cell(), ambiguous = 1.5f * space.cell() + 0.004f, farthest = space.radius() + kReach;
    std::size_t clear = 0, asked = 0;
    buried.clear();
    for (Index i = 0; i < points.size(); ++i) {
      votes[i] = 0;
      if (normals[i].isZero()) continue;
      ++asked;
      struct Way {
        float out;
        bool hollow = false;
      };
      const auto way = [&](float sense) {
        Way w{farthest};
        for (float s = 0; s < farthest; s += stride) {
          const Enclosure::Kind kind = space.at(points[i] + sense * s * normals[i]);
          if (kind == Enclosure::kOutside) {
            w.out = s;
            break;
          }
          w.hollow = w.hollow || (kind == Enclosure::kBody && s < space.radius() + space.cell() + kBehind);
        }
        return w;
      };
      const Way before = way(1), behind = way(-1);
      const float thicker = behind.out - before.out;
      if (before.hollow && behind.hollow)
        buried.push_back(i);
      else if (before.hollow != behind.hollow)
        votes[i] = before.hollow ? -1 : 1;
      else if (std::abs(thicker) > ambiguous)
        votes[i] = std::copysign(0.5f, thicker);
      clear += votes[i] != 0;
    }
    if (2 * clear <= asked) continue;
    for (const Index i : buried) normals[i].setZero();
    return votes;
  }
  return {};
}

/// The same for clouds that enclose nothing, by which side is away from the body's middle: whole patches of one sense decide together.
std::vector<float> axis_votes(const Points& points, const Points& normals, const SortedGrid& grid) {
  SignedSets patches(points.size());
  // The flattest joints first, so that a patch grows around edges and not over them.
  for (const float flat : {0.98f, 0.93f, 0.8f})
    for (Index i = 0; i < points.size(); ++i)
      grid.around(points[i], [&](Index j) {
        const float cosine = normals[i].dot(normals[j]);
        if (j < i && std::abs(cosine) > flat) patches.unite(i, j, cosine < 0);
      });
  constexpr float kSlice = 0.2f;  // the middle is taken at each height
  Eigen::Vector3f low = points.front(), high = low;
  for (const auto& p : points) low = low.cwiseMin(p), high = high.cwiseMax(p);
  std::vector<Eigen::Vector4d> slices(std::min<std::size_t>(static_cast<std::size_t>((high.y() - low.y()) / kSlice) + 1, 10000), Eigen::Vector4d::Zero());
  const auto slice_of = [&](const Eigen::Vector3f& p) -> Eigen::Vector4d& {
    return slices[std::min(static_cast<std::size_t>((p.y() - low.y()) / kSlice), slices.size() - 1)];
  };
  for (const auto& p : points) slice_of(p) += Eigen::Vector4d(p.x(), p.y(), p.z(), 1);
  std::vector<double> sum(points.size(), 0);
  for (Index i = 0; i < points.size(); ++i) {
    const auto [set, against] = patches.find(i);
    const Eigen::Vector4d& slice = slice_of(points[i]);
    sum[set] += (against ? -1 : 1) * normals[i].dot(points[i] - (slice.head<3>() / slice[3]).cast<float>());
  }
  std::vector<float> votes(points.size());
  for (Index i = 0; i < points.size(); ++i) {
    const auto [set, against] = patches.find(i);
    votes[i] = normals[i].isZero() ? 0.0f : against == (sum[set] < 0) ? 0.5f : -0.5f;
  }
  return votes;
}

/// The same by the nearest viewpoint, which must have seen the point from outside.
std::vector<float> view_votes(const Points& points, const Points& normals, std::span<const Eigen::Vector3f> viewpoints) {
  std::vector<float> votes(points.size(), 0);
  for (Index i = 0; i < points.size(); ++i) {
    const Eigen::Vector3f* nearest = nullptr;
    for (const auto& view : viewpoints)
      if (view.allFinite() && (!nearest || (view - points[i]).squaredNorm() < (*nearest - points[i]).squaredNorm())) nearest = &view;
    if (nearest) votes[i] = normals[i].dot((*nearest - points[i]).normalized());
  }
  return votes;
}

/// Turns each normal as its own vote and its neighbours' say. No point binds another for good, so that an error at a crease or where two limbs touch
/// stays there, instead of turning all that hangs on it; a normal whose sense stays open becomes zero.
void turn_outwards(const Points& points, Points& normals, const SortedGrid& grid, float step, std::span<const Eigen::Vector3f> viewpoints) {
  std::vector<float> votes = enclosure_votes(points, normals, step);
  const bool viewed = std::any_of(viewpoints.begin(), viewpoints.end(), [](const Eigen::Vector3f& v) { return v.allFinite(); });
  const bool enclosed = !votes.empty();
  if (!enclosed) votes = viewed ? view_votes(points, normals, viewpoints) : axis_votes(points, normals, grid);
  // A hole lets the outside into the hollow that it opens; what can be seen from where hardly changes with it.
  if (enclosed || !viewed) {
    constexpr float kClearlyOpen = 0.2f;
    const ExteriorView view(points, step);
    for (Index i = 0; i < points.size(); ++i)
      if (const float open = normals[i].isZero() ? 0.0f : view.openness(points[i], normals[i]); std::abs(open) > kClearlyOpen)
        votes[i] = std::copysign(1.0f, open);
  }

  struct Link {
    Index to;
    float weight;
  };
  constexpr int kMostLinks = 24;  // enough to average over; more of a dense cloud's only cost time
  std::vector<Link> links;
  std::vector<std::size_t> first{0};
  std::vector<Link> near;
  for (Index i = 0; i < points.size(); ++i) {
    near.clear();
    grid.around(points[i], [&](Index j) {
      const float cosine = normals[i].dot(normals[j]);
      if (j != i && std::abs(cosine) > 0.5f) near.push_back({j, cosine * std::abs(cosine)});
    });
    const std::size_t stride = near.size() / kMostLinks + 1;
    float total = 1e-6f;
    for (std::size_t k = 0; k < near.size(); k += stride) total += std::abs(near[k].weight);
    for (std::size_t k = 0; k < near.size(); k += stride) links.push_back({near[k].to, near[k].weight / total});
    first.push_back(links.size());
  }
  // Mean-field relaxation in place: the belief of each point in its sense, sure enough to spread over what has no vote of its own.
  constexpr int kRounds = 40;
  constexpr float kVote = 0.7f, kSharpness = 2.0f, kOpen = 0.1f;
  std::vector<float> belief = votes;
  for (int round = 0; round < kRounds; ++round)
    for (Index n = 0; n < points.size(); ++n) {
      const Index i = round % 2 == 0 ? n : static_cast<Index>(points.size()) - 1 - n;
      float sum = kVote * votes[i];
      for (std::size_t k = first[i]; k < first[i + 1]; ++k) sum += links[k].weight * belief[links[k].to];
      belief[i] = std::tanh(kSharpness * sum);
    }
  for (Index i = 0; i < points.size(); ++i) {
    if (std::abs(belief[i]) < kOpen) normals[i].setZero();
    if (belief[i] < 0) normals[i] = -normals[i];
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

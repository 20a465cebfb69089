// Edge operations of isotropic remeshing; each keeps the surface a manifold with one rim, and none moves a vertex that stays.
#include "fit/train/surface.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <map>

namespace booth::fit::train {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

SparseRow middle(const SparseRow& a, const SparseRow& b) {
  std::map<int, float> sum;
  for (const auto& [i, w] : a) sum[i] += w / 2;
  for (const auto& [i, w] : b) sum[i] += w / 2;
  return {sum.begin(), sum.end()};
}

bool contains(const std::vector<int>& list, int value) { return std::find(list.begin(), list.end(), value) != list.end(); }

}  // namespace

Surface::Surface(std::vector<Eigen::Vector3d> positions, std::vector<std::array<int, 3>> faces, std::vector<char> midline)
    : position_(std::move(positions)), midline_(std::move(midline)) {
  row_.resize(position_.size());
  vertex_faces_.resize(position_.size());
  for (int v = 0; v < vertex_count(); ++v) row_[at(v)] = {{v, 1.0f}};
  for (const auto& f : faces) add_face(f);
}

std::vector<std::array<int, 3>> Surface::faces() const {
  std::vector<std::array<int, 3>> list;
  for (const auto& f : face_)
    if (f[0] >= 0) list.push_back(f);
  return list;
}

void Surface::add_face(std::array<int, 3> corners) {
  for (int v : corners) vertex_faces_[at(v)].push_back(static_cast<int>(face_.size()));
  face_.push_back(corners);
}

void Surface::remove_face(int face) {
  for (int v : face_[at(face)]) std::erase(vertex_faces_[at(v)], face);
  face_[at(face)][0] = -1;
}

std::vector<Surface::Edge> Surface::edges() const {
  std::vector<Edge> list;
  for (const auto& f : face_) {
    if (f[0] < 0) continue;
    for (int i = 0; i < 3; ++i) {
      const int a = std::min(f[i], f[(i + 1) % 3]), b = std::max(f[i], f[(i + 1) % 3]);
      list.push_back({a, b, length(a, b)});
    }
  }
  std::sort(list.begin(), list.end(), [](const Edge& x, const Edge& y) { return x.a != y.a ? x.a < y.a : x.b < y.b; });
  list.erase(std::unique(list.begin(), list.end(), [](const Edge& x, const Edge& y) { return x.a == y.a && x.b == y.b; }), list.end());
  return list;
}

std::vector<int> Surface::neighbours(int v) const {
  std::vector<int> list;
  for (int f : vertex_faces_[at(v)])
    for (int n : face_[at(f)])
      if (n != v && !contains(list, n)) list.push_back(n);
  return list;
}

std::vector<int> Surface::shared_faces(int a, int b) const {
  std::vector<int> list;
  for (int f : vertex_faces_[at(a)])
    if (contains(vertex_faces_[at(b)], f)) list.push_back(f);
  return list;
}

int Surface::opposite(int face, int a, int b) const {
  for (int v : face_[at(face)])
    if (v != a && v != b) return v;
  return -1;
}

Eigen::Vector3d Surface::normal(int a, int b, int c) const { return (position(b) - position(a)).cross(position(c) - position(a)); }

bool Surface::may_collapse(int from, int onto) const {
  const auto shared = shared_faces(from, onto);
  if (shared.empty()) return false;
  const bool rim = shared.size() == 1;
  if (midline(from) && !rim) return false;
  const auto around_from = neighbours(from), around_onto = neighbours(onto);
  std::size_t common = 0;
  for (int n : around_from) common += contains(around_onto, n);
  if (common != shared.size()) return false;  // the link condition
  for (int f : shared)
    if (const int o = opposite(f, from, onto); vertex_faces_[at(o)].size() <= (midline(o) ? 2u : 3u)) return false;
  if (midline(onto))  // no new edge across the half between two vertices of the rim
    for (int n : around_from)
      if (n != onto && midline(n) && !contains(around_onto, n) && !(rim && shared_faces(from, n).size() == 1)) return false;
  return true;
}

bool Surface::keeps_shape(int from, int onto, double longest) const {
  const auto shared = shared_faces(from, onto);
  for (int f : vertex_faces_[at(from)]) {
    if (contains(shared, f)) continue;
    auto corners = face_[at(f)];
    const Eigen::Vector3d before = normal(corners[0], corners[1], corners[2]);
    for (int& v : corners) {
      if (v == from) v = onto;
    }
    const Eigen::Vector3d after = normal(corners[0], corners[1], corners[2]);
    double longest_here = 0;
    for (int i = 0; i < 3; ++i) longest_here = std::max(longest_here, length(corners[at(i)], corners[at((i + 1) % 3)]));
    if (longest_here > longest) return false;
    if (after.norm() < 0.15 * longest_here * longest_here) return false;  // a sliver
    if (after.dot(before) < 0.4 * after.norm() * before.norm()) return false;
  }
  return true;
}

void Surface::collapse(int from, int onto) {
  for (int f : shared_faces(from, onto)) remove_face(f);
  const auto rest = vertex_faces_[at(from)];
  for (int f : rest) {
    for (int& v : face_[at(f)])
      if (v == from) v = onto;
    vertex_faces_[at(onto)].push_back(f);
  }
  vertex_faces_[at(from)].clear();
}

void Surface::split(int a, int b) {
  const auto shared = shared_faces(a, b);
  const int m = vertex_count();
  position_.push_back((position(a) + position(b)) / 2);
  row_.push_back(middle(row(a), row(b)));
  midline_.push_back(shared.size() == 1);
  vertex_faces_.emplace_back();
  for (int f : shared) {
    auto first = face_[at(f)], second = first;
    remove_face(f);
    for (int& v : first)
      if (v == a) v = m;
    for (int& v : second)
      if (v == b) v = m;
    add_face(first);
    add_face(second);
  }
}

bool Surface::flip_if_better(int a, int b) {
  const auto shared = shared_faces(a, b);
  if (shared.size() != 2) return false;
  // a, b as they run in the first face: a -> b -> c.
  const auto& f = face_[at(shared[0])];
  for (int i = 0; i < 3; ++i)
    if (f[at(i)] == b && f[at((i + 1) % 3)] == a) std::swap(a, b);
  const int c = opposite(shared[0], a, b), d = opposite(shared[1], a, b);
  if (c == d || (midline(c) && midline(d)) || contains(neighbours(c), d)) return false;
  const auto excess = [&](int v, int change) {
    const int valence = static_cast<int>(vertex_faces_[at(v)].size()) + change - (midline(v) ? 3 : 6);
    return valence * valence;
  };
  if (vertex_faces_[at(a)].size() <= (midline(a) ? 2u : 3u) || vertex_faces_[at(b)].size() <= (midline(b) ? 2u : 3u)) return false;
  const int before = excess(a, 0) + excess(b, 0) + excess(c, 0) + excess(d, 0);
  const int after = excess(a, -1) + excess(b, -1) + excess(c, 1) + excess(d, 1);
  if (after >= before) return false;
  const Eigen::Vector3d n0 = normal(a, b, c), n1 = normal(b, a, d), m0 = normal(a, d, c), m1 = normal(d, b, c);
  if (n0.dot(n1) < 0.85 * n0.norm() * n1.norm()) return false;  // a ridge: the flip would cut it
  const double long_side = std::max({length(a, b), length(c, d), length(a, c), length(b, d)});
  for (const auto& m : {m0, m1})
    if (m.norm() < 0.25 * long_side * long_side || m.dot(n0 + n1) < 0.8 * m.norm() * (n0 + n1).norm()) return false;
  remove_face(shared[0]);
  remove_face(shared[1]);
  add_face({a, d, c});
  add_face({d, b, c});
  return true;
}

void Surface::remove_vertices(const std::vector<char>& marked) {
  // Marked onto marked first, so that each bag is gathered in one vertex before it joins the rim of its opening.
  for (bool among_themselves : {true, false})
    for (bool changed = true; changed;) {
      changed = false;
      auto list = edges();
      std::stable_sort(list.begin(), list.end(), [](const Edge& x, const Edge& y) { return x.length < y.length; });
      for (const auto& e : list)
        for (auto [from, onto] : {std::pair{e.a, e.b}, std::pair{e.b, e.a}}) {
          if (!alive(from) || !alive(onto) || !marked[at(from)] || (among_themselves && !marked[at(onto)])) continue;
          if (!may_collapse(from, onto)) continue;
          collapse(from, onto);
          changed = true;
        }
    }
}

void Surface::remesh(double target, int rounds) {
  const double longest = target * 4 / 3, shortest = target * 4 / 5;
  for (int round = 0; round < rounds; ++round) {
    auto list = edges();
    std::stable_sort(list.begin(), list.end(), [](const Edge& x, const Edge& y) { return x.length > y.length; });
    for (const auto& e : list)
      if (e.length > longest && !shared_faces(e.a, e.b).empty()) split(e.a, e.b);

    list = edges();
    std::stable_sort(list.begin(), list.end(), [](const Edge& x, const Edge& y) { return x.length < y.length; });
    for (const auto& e : list) {
      if (e.length >= shortest) break;
      for (auto [from, onto] : {std::pair{e.a, e.b}, std::pair{e.b, e.a}}) {
        if (!alive(from) || !alive(onto) || !may_collapse(from, onto) || !keeps_shape(from, onto, longest)) continue;
        collapse(from, onto);
        break;
      }
    }
    for (int pass = 0; pass < 3; ++pass)
      for (const auto& e : edges()) flip_if_better(e.a, e.b);
  }
}

}  // namespace booth::fit::train

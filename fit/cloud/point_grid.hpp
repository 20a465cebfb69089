// Nearest-point queries in a small set of points that moves between queries: the model's vertices, posed anew in every iteration.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace booth::fit {

/// A uniform grid over the points' bounding box, filled by a counting sort. All memory is taken in the constructor. Queries are const and may
/// run on many threads at once; rebuild() must not run beside them. The same points and query give the same answer on every machine.
class PointGrid {
 public:
  /// At most `capacity` points. `cell` (m): the edge of a cell; about twice the points' spacing is quickest, and 0 picks it for points spread
  /// over a human body. It grows by itself when the points lie so far apart that the cells would not fit. Throws std::invalid_argument.
  explicit PointGrid(int capacity, float cell = 0);

  int capacity() const { return static_cast<int>(sorted_.size()); }
  std::size_t memory_bytes() const;

  /// Indexes n points (metres; anything beyond the capacity and any that is not finite or a kilometre away is left out). The coordinates are copied.
  void rebuild(const float* x, const float* y, const float* z, int n) { rebuild(x, y, z, nullptr, nullptr, nullptr, n); }
  /// The same with unit normals, for queries that ask for them.
  void rebuild(const float* x, const float* y, const float* z, const float* nx, const float* ny, const float* nz, int n);

  /// Index of the point nearest to p and nearer than max_distance (m); -1 when there is none. Exact.
  int nearest(const Eigen::Vector3f& p, float max_distance) const;
  /// The same among the points whose normal makes an angle with `normal` whose cosine is greater than min_cosine. Without normals: -1.
  int nearest(const Eigen::Vector3f& p, float max_distance, const Eigen::Vector3f& normal, float min_cosine) const;

 private:
  struct Entry {
    float x, y, z;
    int index;
  };
  struct Normal {
    float x, y, z, unused;
  };
  template <typename Gate>
  int search(const Eigen::Vector3f& p, float max_distance, Gate gate) const;

  float wanted_cell_, cell_ = 1, inverse_cell_ = 1;
  Eigen::Vector3f origin_ = Eigen::Vector3f::Zero();
  int nx_ = 0, ny_ = 0, nz_ = 0;
  int count_ = 0;
  bool has_normals_ = false;
  std::vector<Entry> sorted_;  // in the order of the cells, x fastest, so that neighbouring cells of a row are one stretch of memory
  std::vector<Normal> sorted_normal_;
  std::vector<std::int32_t> start_;  // first entry of each cell, and one past the last
  std::vector<std::int32_t> cell_of_;
};

}  // namespace booth::fit

// The nearest point of a cloud in one look-up, for the tens of thousands of queries that a swarm makes in a frame.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "fit/cloud/observation.hpp"
#include "fit/parallel.hpp"

namespace booth::fit {

struct NearestFieldSettings {
  float cell = 0.02f;  ///< m; grows by itself for a cloud whose box takes more than max_cells
  float band = 0.30f;  ///< m; beyond this distance from the cloud there is no answer
  int max_points = 120000;
  int max_cells = 1'500'000;
  float margin = 0;           ///< cells that the grid and its answers reach further than the band on every side
  int max_plane = 320 * 320;  ///< cells in one layer along z
};

/// A dense grid around the cloud whose cells know the point that is (nearly) nearest to their centre. All memory is taken in the constructor.
/// Queries are const and may run on many threads; rebuild() must not run beside them. The same bits for any number of threads and on every machine.
class NearestField {
 public:
  /// Throws std::invalid_argument that names the setting.
  explicit NearestField(NearestFieldSettings settings = {});

  /// Indexes the cloud's points (at most max_points; points that are not finite are left out). Allocates nothing.
  void rebuild(const Cloud& cloud, WorkerPool& pool);
  /// The same in two steps: the grid about a box (false: none, nothing will be found), then the points, all inside that box.
  bool set_box(const Eigen::Vector3f& low, const Eigen::Vector3f& high);
  void fill(const Cloud& cloud, WorkerPool& pool);

  /// Index of a point about as near to p as the nearest; -1 when p is about the band or more away from all points. One look-up.
  int nearest(const Eigen::Vector3f& p) const {
    const Eigen::Vector3f local = (p - origin_) * inverse_cell_;
    if (!(local.x() >= 0 && local.y() >= 0 && local.z() >= 0 && local.x() < size_.x() && local.y() < size_.y() && local.z() < size_.z())) return -1;
    return index_[static_cast<std::size_t>((static_cast<int>(local.z()) * ny_ + static_cast<int>(local.y())) * nx_ + static_cast<int>(local.x()))];
  }
  /// The nearest of the points that the eight cells around p know: several times the price, and a fraction of the error near the surface.
  /// `cloud` is the one of the last rebuild().
  int nearest_refined(const Cloud& cloud, const Eigen::Vector3f& p) const;

  float cell() const { return cell_; }
  /// The grid: its low corner, cells along each axis, and each cell's point (-1: none) and squared distance of that from the cell's centre, x fastest.
  const Eigen::Vector3f& origin() const { return origin_; }
  Eigen::Vector3i cells() const { return {nx_, ny_, nz_}; }
  const std::int32_t* index() const { return index_.data(); }
  const float* distance2() const { return distance2_.data(); }
  float band() const { return settings_.band; }
  std::size_t memory_bytes() const;

 private:
  float band_and_margin() const { return settings_.band + settings_.margin * cell_; }
  void seed_and_spread_in_plane(const Cloud& cloud, int z);
  void spread_across_planes(const Cloud& cloud, int y);

  NearestFieldSettings settings_;
  float cell_ = 1, inverse_cell_ = 1;
  Eigen::Vector3f origin_ = Eigen::Vector3f::Zero();
  Eigen::Vector3f size_ = Eigen::Vector3f::Zero();    // number of cells, as floats
  int nx_ = 0, ny_ = 0, nz_ = 0;                      // nx_ is a multiple of the vector width
  std::vector<std::int32_t> index_;                   // x fastest
  std::vector<float> distance2_;                      // of the cell's centre from that point; band^2 where there is none
  std::vector<std::int32_t> of_plane_, plane_start_;  // the points in the order of their planes
  std::vector<std::int16_t> plane_;
};

}  // namespace booth::fit

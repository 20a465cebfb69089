// From which directions each part of a cloud can be seen: the outside of a surface is open, its inside faces the opposite wall, holes or not.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace booth::fit {

/// A voxel grid of the cloud; from each occupied cell, 64 rays in evenly spread directions either leave the cloud or hit it. Allocates; off the frame path.
/// Const calls are thread-safe.
class ExteriorView {
 public:
  /// `spacing` (m): about how far neighbouring points are apart. The cloud is not empty and lies within a kilometre.
  ExteriorView(const std::vector<Eigen::Vector3f>& points, float spacing);

  /// How much more of the half space before p (where `normal`, a unit vector, points) is open than of that behind it, from -1 to 1.
  /// `p` is one of the points.
  float openness(const Eigen::Vector3f& p, const Eigen::Vector3f& normal) const;

 private:
  static constexpr int kDirections = 64;
  std::size_t cell_of(const Eigen::Vector3f& p) const;

  float cell_ = 1;
  Eigen::Vector3f low_ = Eigen::Vector3f::Zero();
  int n_[3] = {1, 1, 1};
  std::vector<Eigen::Vector3f> direction_;
  std::vector<std::int32_t> entry_;  ///< per cell: its place in `open_`, -1 where the cell is empty
  std::vector<std::uint64_t> open_;  ///< per occupied cell: bit k is set where direction k leads out
};

}  // namespace booth::fit

// Which of the things on the stage is the person: components on a coarse grid, joined over small gaps, judged by their size.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "fit/cloud/cloud_builder.hpp"

namespace booth::fit {

/// What a voxel's points belong to.
enum class VoxelVerdict : std::uint8_t { speck, person, other };

/// All memory is taken in the constructor, for the worst case. Not thread-safe but for verdict().
class VoxelComponents {
 public:
  /// Covers the stage of `settings`. Throws std::invalid_argument when that takes more than 4 million voxels.
  explicit VoxelComponents(const CloudSettings& settings);

  void clear();
  /// Counts a point (CMU frame) and returns the number of its voxel among the occupied ones; points beyond the stage count at its edge.
  int insert(const Eigen::Vector3f& p);
  /// Decides about all voxels, which report.frames cameras saw above report.floor_height; fills persons, other_components and touches_border. True when there
  /// is a person (CloudBuilder::build() says which).
  bool judge(CloudReport& report, const Followed& followed);
  VoxelVerdict verdict(int occupied) const { return occupied_[static_cast<std::size_t>(occupied)].verdict; }

  std::size_t memory_bytes() const;

 private:
  struct Occupied {
    std::int32_t voxel, points, parent;
    std::int32_t component;  // -1: a voxel with too few points to hold anything together
    VoxelVerdict verdict;
    bool near;  // the bones that are followed; known where somebody is
  };
  struct Component {
    std::int32_t parent;  // of the group that it joined
    std::int32_t voxels;
    std::int32_t volume;  // voxels, the hollow between the lowest and the highest of each column included
    int low[3], high[3];  // corners, in voxels
    double sum_x, sum_z;  // of the voxels' coordinates
    std::int32_t near;    // voxels near the bones that are followed
    bool person_sized;
  };
  struct Offset {
    int distance2, step;
  };
  int find_voxel(int i);
  int find_group(int c);
  void connect();
  void measure();
  void rejoin(float floor_height);
  void unite_groups(int a, int b);
  /// `share` of what it takes to be a person's size.
  bool is_person_sized(const Component& c, float share = 1) const;
  void find_near(const Followed& followed);
  int choose(CloudReport& report, const Followed& followed) const;
  bool others_touch(int chosen, const CloudReport& report, bool before);

  CloudSettings settings_;
  Eigen::Vector3f origin_;
  float inverse_voxel_;
  float crouching_volume_ = 0;
  int pad_;                             // empty layers on each side, so that no look-up of a neighbour leaves the grid
  int nx_, ny_, nz_;                    // these included
  std::vector<std::int32_t> index_of_;  // of each voxel among the occupied; -1 = empty
  std::vector<Occupied> occupied_;
  std::vector<Component> components_;
  std::vector<std::int32_t> loose_;  // voxels of components that are not a person's size, crumbs left out
  std::vector<Offset> ball_;         // offsets within rejoin_gap, nearest first
};

}  // namespace booth::fit

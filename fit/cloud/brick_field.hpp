// The nearest point of a cloud in one look-up, for the millions of queries that a swarm makes in a frame.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "fit/cloud/field_view.hpp"
#include "fit/cloud/nearest_field.hpp"
#include "fit/cloud/observation.hpp"
#include "fit/parallel.hpp"

namespace booth::fit {

struct BrickFieldSettings {
  float cell = 0.0125f;  ///< m, near the cloud; grows by itself for a cloud whose box takes more than max_bricks
  float fine = 0.09f;    ///< m; bricks up to about so far from the cloud have cells, those further away one answer each
  float band = 0.30f;    ///< m; beyond this distance from the cloud there is no answer
  int max_points = 120000;
  int max_bricks = 120'000;      ///< of 4 x 4 x 4 cells, in the cloud's box
  int max_fine_bricks = 20'000;  ///< bricks with cells; where a cloud takes more, the last ones have one answer each
};

/// The field of fit/cloud/field_view.hpp with its memory, all taken in the constructor. Queries are const and may run on many threads; rebuild() must not
/// run beside them. The same bits for any number of threads and on every machine.
class BrickField {
 public:
  /// Throws std::invalid_argument that names the setting.
  explicit BrickField(const BrickFieldSettings& settings = {});

  /// Indexes the cloud's points (at most max_points; points that are not finite are left out). Allocates nothing; keeps nothing of the cloud.
  void rebuild(const Cloud& cloud, WorkerPool& pool);

  const FieldView& view() const { return view_; }
  /// A point about as near to p as the nearest of the cloud; false when p is about the band or more away from all points. One look-up.
  bool nearest(const Eigen::Vector3f& p, Eigen::Vector3f& out) const;
  /// Bricks in the box, and those of them that have cells, after the last rebuild().
  int bricks() const { return bricks_; }
  int fine_bricks() const { return fine_bricks_; }
  std::size_t memory_bytes() const;

 private:
  /// One task's candidates for the cells of a brick.
  struct Scratch {
    std::vector<float> x, y, z, distance2;
    std::vector<std::int32_t> chosen;
  };
  static constexpr float kSparse = 0.6f;  ///< of a brick's edge; further from the cloud the sparse points are candidates enough

  void clear();
  void sort_points(const Cloud& cloud, int n, WorkerPool& pool);
  void choose_sparse(WorkerPool& pool);
  std::int32_t pack(const float* corner, float x, float y, float z) const;
  void describe_bricks(WorkerPool& pool);
  std::int32_t describe_far(const float* corner, std::int32_t guess) const;
  void describe_cells(std::int32_t brick, Scratch& scratch);

  BrickFieldSettings settings_;
  FieldView view_;
  int bricks_ = 0, fine_bricks_ = 0, occupied_count_ = 0;
  NearestField coarse_;  ///< its cells are the bricks
  Cloud sparse_;         ///< of each block of 2 x 2 x 2 cells the middle point and the outermost ones, brick by brick: what coarse_ indexes
  std::vector<std::int32_t> brick_, cell_;
  std::vector<std::int32_t> key_, sorted_;          ///< each point's brick and cell; the points by brick
  std::vector<float> x_, y_, z_;                    ///< ... and where they are
  std::vector<std::int32_t> start_, sparse_start_;  ///< where each brick's points begin, and its sparse ones
  std::vector<std::int32_t> of_sparse_, sparse_count_;
  std::vector<std::int32_t> occupied_, fine_;  ///< bricks with points; bricks with cells
  Scratch scratch_[32];
};

}  // namespace booth::fit

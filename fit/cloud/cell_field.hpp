// The nearest point of a cloud in one look-up, for the millions of queries that a swarm makes in a frame.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "fit/cloud/cell_view.hpp"
#include "fit/cloud/observation.hpp"
#include "fit/parallel.hpp"

namespace booth::fit {

/// Of the nearest-point field, here and on a device.
struct FieldSettings {
  float cell = 0.0125f;     ///< m, the finest; grows by itself for a cloud whose box takes more than max_bricks
  float fine = 0.09f;       ///< m; on a device: bricks up to about so far from the cloud have cells, those further away one answer each
  float band = 0.30f;       ///< m; beyond this distance from the cloud there is no answer; at most 27 cells
  int max_points = 120000;  ///< at most 131072
  int max_bricks = 80'000;  ///< of 4 x 4 x 4 (finest) cells, in the cloud's box and the band around it
};

/// The field of fit/cloud/cell_view.hpp with its memory, all taken in the constructor. Within some centimetres of the cloud each cell has an answer of its
/// own; further away, where the distance is flatter, 2 x 2 x 2 cells share one. Queries are const and may run on many threads; rebuild() must not run
/// beside them. The same bits for any number of threads and on every machine.
class CellField {
 public:
  /// Throws std::invalid_argument that names the setting.
  explicit CellField(const FieldSettings& settings = {});

  /// Indexes the cloud's points (at most max_points; points that are not finite are left out). Allocates nothing; keeps nothing of the cloud.
  void rebuild(const Cloud& cloud, WorkerPool& pool);

  const CellView& view() const { return view_; }
  /// A point about as near to p as the nearest of the cloud; false when p is about the band or more away from all points. One look-up.
  bool nearest(const Eigen::Vector3f& p, Eigen::Vector3f& out) const;
  /// Cells in the box after the last rebuild().
  int cells() const { return nx_ * ny_ * nz_; }
  /// What the view shows, from the first cell on: cells() words.
  const std::int32_t* words() const { return fine_.data(); }
  std::size_t memory_bytes() const;

 private:
  void clear();
  void set_box(const float* low, const float* high);
  void sort_points(const Cloud& cloud, int n, WorkerPool& pool);
  void mark_occupied(int brick_z);
  void mark_near(int brick_y, int brick_z);
  void describe_layers(int brick_z);
  void describe_layer(int z);
  void spread_across_layers(int brick_y);
  void describe_coarse_layer(int z);
  void spread_across_coarse_layers(int y);
  void spread_in_coarse_layer(int z);
  void write_cells(int z);

  std::int32_t* row(int y, int z) { return fine_.data() + (static_cast<std::ptrdiff_t>(z) * ny_ + y) * nx_; }
  std::int32_t* coarse_row(int y, int z) { return coarse_.data() + (static_cast<std::ptrdiff_t>(z) * (ny_ / 2) + y) * (nx_ / 2); }
  std::uint8_t* chunks(std::vector<std::uint8_t>& flags, int y, int z) { return flags.data() + ((z >> 2) * (ny_ / 4) + (y >> 2)) * (nx_ / 16); }

  FieldSettings settings_;
  CellView view_;
  int nx_ = 2, ny_ = 2, nz_ = 2;             // fine cells; multiples of 16, 4 and 4
  float origin_[3] = {0, 0, 0};              // m; the first fine cell's centre
  float inverse_ = 1;                        // fine cells per metre
  float limit2_ = 0;                         // squared distance of an answer, in units of 2^-52 squared fine cells
  std::vector<std::int32_t> fine_, coarse_;  // words: of the fine grid, which the view shows (until write_cells() of near chunks only), the coarse one
  std::vector<std::uint8_t> occupied_;       // bricks of 4 x 4 x 4 fine cells with points
  std::vector<std::uint8_t> near_;           // chunks of four bricks along x that have or touch a brick with points
  std::vector<float> x_, y_, z_;             // the points in fine cells ...
  std::vector<float> sorted_x_, sorted_y_, sorted_z_;  // ... and in the order of their layers
  std::vector<std::int32_t> word_;                     // of the sorted points, from the first fine cell's centre
  std::vector<std::int16_t> layer_;                    // of each point, -1 for none
  std::vector<std::int32_t> start_;                    // where each layer's sorted points begin
  std::vector<std::int32_t> next_;                     // [task][layer]: where the task's next point of the layer goes
};

}  // namespace booth::fit

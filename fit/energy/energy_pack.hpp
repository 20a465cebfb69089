// Owns the packed arrays behind an EnergyView: made once from a body model, a pose prior and the number of vertices to compare.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "fit/body/body_model.hpp"
#include "fit/energy/batch_energy.hpp"
#include "fit/energy/energy_view.hpp"
#include "fit/energy/terms.hpp"
#include "fit/prior/pose_prior.hpp"

namespace booth::fit {

struct EnergyPackSettings {
  int shape_count = 15;  ///< first so many coefficients; fewer where the model has fewer
  int vertices = 1008;   ///< evenly spread; rounded down to whole batches; the published energy sums over 1,000
  PaperWeights weights{};
};

/// Immutable after construction; the view's pointers live as long as the pack. Movable: the view follows.
class EnergyPack {
 public:
  /// Throws std::invalid_argument when there is not even one batch of vertices.
  EnergyPack(const BodyModel& model, const PosePrior& prior, const EnergyPackSettings& settings = {});

  /// Valid until the pack is moved or destroyed.
  EnergyView view() const;
  BatchView batch_view() const;
  int dimensions() const { return kDofs + shape_count_; }
  int shape_count() const { return shape_count_; }
  int vertices() const { return static_cast<int>(vertex_.size()); }
  /// The model's vertex at each place of the pack.
  const std::vector<int>& vertex() const { return vertex_; }
  std::size_t memory_bytes() const;

  // The arrays with their sizes, for a back-end that copies them elsewhere; see EnergyView for their layout.
  const std::vector<std::int32_t>& shape() const { return shape_; }
  const std::vector<float>& weight() const { return weight_; }
  const std::vector<Segment>& segment() const { return segment_; }
  const std::vector<std::int32_t>& segment_start() const { return segment_start_; }
  const std::vector<PartStep>& part() const { return part_; }
  const std::vector<float>& joint() const { return joint_; }
  const std::vector<float>& pose_mean() const { return pose_mean_; }
  const std::vector<float>& pose_component() const { return pose_component_; }

 private:
  void order_vertices(const BodyModel& model, int count);
  void pack_shapes(const BodyModel& model);
  void pack_batches(const std::vector<Eigen::MatrixXd>& part);
  void pack_chain(const BodyModel& model);

  PaperWeights weights_;
  int shape_count_ = 0;
  float position_unit_ = 1;
  std::vector<int> vertex_;
  std::vector<std::int32_t> shape_;
  std::vector<float> weight_;
  std::vector<Segment> segment_;
  std::vector<std::int32_t> segment_start_;
  std::vector<PartStep> part_;
  std::vector<float> joint_, pose_mean_, pose_component_;
  BatchView batch_view_;           ///< without pointers
  std::vector<int> batch_vertex_;  ///< places in vertex_, in the batches' order
  std::vector<std::int32_t> batch_, batch_segment_start_;
  std::vector<BatchSegment> batch_segment_;
};

/// The part that moves a bone.
int part_of_bone(int bone);

}  // namespace booth::fit

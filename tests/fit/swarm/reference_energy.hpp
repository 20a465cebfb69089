// The paper's whole energy (eq. 4) of one particle in plain terms, with Eigen and the poser's kinematics: what the packed energy is tested against.
#pragma once

#include <vector>

#include "fit/body/body_model.hpp"
#include "fit/cloud/cell_field.hpp"
#include "fit/energy/terms.hpp"
#include "fit/prior/pose_prior.hpp"

namespace booth::tests {

using namespace fit;  // NOLINT(google-build-using-namespace)

/// Immutable after construction but for set_observation(); evaluate() is thread-safe. A particle is q (36) and the first `shape_count` coefficients.
class ReferenceEnergy {
 public:
  ReferenceEnergy(const BodyModel& model, const PosePrior& prior, int shape_count, int vertex_count, PaperWeights weights = {});

  int dimensions() const { return kDofs + shape_count_; }
  int vertex_count() const { return count_; }

  struct Terms {
    double point = 0, plane = 0, shape = 0, bone = 0, pose = 0;  ///< unweighted, in the units of terms.hpp
    double plane_at_edge = 0;  ///< what of `plane` may jump because a vertex lies within kEdge of the end of the field's band; 0 for nearly all particles
    double total(const PaperWeights& w) const { return w.point * point + w.plane * plane + w.shape * shape + w.bone * bone + w.pose * pose; }
  };

  /// The field must outlive the evaluations.
  void set_field(const CellField& field) { field_ = &field; }
  Terms evaluate(const float* particle) const;
  double energy(const float* particle) const { return evaluate(particle).total(weights_); }

  /// Distance in metres that a vertex outside the field's band is charged with.
  static constexpr float kOutside = 0.3f;
  /// m; nearer than this to the band's edge, rounding in the packed energy may put a vertex on the other side.
  static constexpr float kEdge = 2e-5f;

 private:
  const BodyModel& model_;
  const PosePrior& prior_;
  PaperWeights weights_;
  int shape_count_, count_;
  // Groups of kLane vertices; within a group [coordinate or coefficient][lane], contiguous, so that a particle streams through memory once.
  static constexpr int kLane = 16;
  std::vector<float> shape_;  ///< per group: mean x, y, z and normal x, y, z, then for each coefficient the same six; kLane floats each
  std::vector<std::uint8_t> bone_;
  std::vector<float> weight_;
  const CellField* field_ = nullptr;
};

}  // namespace booth::tests

// SCAPE's model (Anguelov et al. 2005): every triangle deforms by a part's rotation, a pose deformation regressed from joint twists, and a shape deformation by
// PCA.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "fit/body/body_model.hpp"
#include "fit/prior/pose_prior.hpp"

namespace booth::accuracy {

/// A baseline of the study, trained once for a body model. Differs from the original in three ways, since its scans are not open (docs/reference/accuracy.md):
/// the posed templates are our skinned mean body with the volume at each joint restored; triangles' deformations follow from their edges and normal instead of
/// from neighbours; shapes are drawn from our shape space. Immutable and thread-safe after construction.
class ScapeModel {
 public:
  static constexpr int kTemplates = 70;  ///< posed templates, as in the original
  static constexpr int kShapes = 15;
  static constexpr int kShapeBodies = 60;

  /// Poses are the first 70 exemplars of the prior. Takes seconds.
  ScapeModel(const fit::BodyModel& model, const fit::PosePrior& prior);

  using Rotations = std::array<Eigen::Matrix3f, fit::kBones>;  ///< of each part from the template's pose, world; only parts() are used
  using Deformations = std::vector<Eigen::Matrix3f>;           ///< one a triangle

  const fit::BodyModel& model() const { return model_; }
  int triangles() const { return static_cast<int>(part_.size()); }
  int part(int triangle) const { return part_[static_cast<std::size_t>(triangle)]; }
  /// Edges 0-1 and 0-2 of the template's triangle.
  Eigen::Vector3f edge(int triangle, int k) const {
    return template_.col(model_.data().faces(k + 1, triangle)) - template_.col(model_.data().faces(0, triangle));
  }
  const fit::Vertices& template_vertices() const { return template_; }

  /// Q of every triangle for the twists between neighbouring parts.
  void pose_deformations(const Rotations& rotations, Deformations& out) const;
  /// S of one triangle.
  Eigen::Matrix3f shape_mean(int triangle) const;
  Eigen::Matrix3f shape_direction(int triangle, int k) const;

 private:
  static constexpr int kMostTwists = 5;                  ///< joints of a part that count
  static constexpr int kFeatures = 3 * kMostTwists + 1;  ///< twists and a constant
  using Features = Eigen::Matrix<float, kFeatures, 1>;
  void find_parts();
  Features features(int part, const Rotations& rotations) const;
  fit::Vertices posed_template(const fit::PoseVector& q, Rotations& rotations) const;
  void train_pose(const fit::PosePrior& prior);
  void train_shape();

  const fit::BodyModel& model_;
  fit::Vertices template_;
  std::vector<int> part_;
  std::array<std::vector<std::pair<int, int>>, fit::kBones> joints_;  ///< (parent part, child part) of the joints of each part
  std::vector<Eigen::Matrix<float, 9, kFeatures>> regression_;
  Eigen::VectorXf shape_mean_;
  Eigen::MatrixXf shape_;  ///< 9 T x kShapes, a standard deviation each
};

/// Deformation that takes one triangle to another, from two edges and the normal.
Eigen::Matrix3f triangle_deformation(const Eigen::Vector3f& a1, const Eigen::Vector3f& a2, const Eigen::Vector3f& b1, const Eigen::Vector3f& b2);

}  // namespace booth::accuracy

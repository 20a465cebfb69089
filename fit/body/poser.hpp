// A body in motion: shapes and poses the model's vertices into fixed buffers and gives the derivative of any of them.
#pragma once

#include <array>
#include <vector>

#include "fit/body/body_model.hpp"

namespace booth::fit {

/// Structure-of-arrays view of a posed body. Allocates in the constructor only. Not thread-safe while it is being set; const calls are.
class Poser {
 public:
  /// `shape_count`: how many of the model's coefficients it follows; those behind are zero. The poser's vertices are the first
  /// `vertex_count` of spread_vertices(), so that any leading part of them is evenly spread over the body. The model must outlive the poser.
  Poser(const BodyModel& model, int shape_count, int vertex_count);

  /// Resting vertices and normals for beta (size <= shape_count()).
  void set_shape(const ShapeVector& beta);
  /// Posed vertices and normals for q and the current shape.
  void set_pose(const PoseVector& q);
  /// Needed before shape_row(): how each bone's transform changes with each coefficient at the current pose.
  void prepare_shape_derivatives();

  int size() const { return static_cast<int>(x.size()); }
  int shape_count() const { return shape_count_; }
  const BodyModel& model() const { return *model_; }
  const Kinematics& kinematics() const { return kinematics_; }
  const Points3& rest_joints() const { return rest_joints_; }
  const Points3& bone_vectors() const { return bone_vectors_; }
  Eigen::Vector3f position(int i) const { return {x[i], y[i], z[i]}; }
  Eigen::Vector3f normal(int i) const { return {nx[i], ny[i], nz[i]}; }
  /// Index in the model of the poser's vertex i.
  int model_vertex(int i) const { return vertex_[static_cast<std::size_t>(i)]; }
  /// The bone with the largest weight on vertex i.
  int main_bone(int i) const { return bone_[static_cast<std::size_t>(i)][0]; }

  /// row[k] += scale * d . dv_i/dq_k for all 36 entries.
  void pose_row(int i, const Eigen::Vector3f& d, float* row) const;
  /// row[k] += d . dv_i/dbeta_k for the shape_count() coefficients.
  void shape_row(int i, const Eigen::Vector3f& d, float* row) const;
  /// The same for the joints themselves: d joint / dq (3 x 36) and d joint / dbeta.
  Eigen::Matrix<double, 3, kDofs> joint_pose_jacobian(int joint) const;
  Eigen::Vector3d joint_shape_derivative(int joint, int k) const { return joint_shape_[static_cast<std::size_t>(k)].col(joint); }

  /// Taken in the constructor, the model itself not counted.
  std::size_t memory_bytes() const;

  /// Posed vertices and unit normals, CMU frame, metres.
  std::vector<float> x, y, z, nx, ny, nz;

 private:
  const BodyModel* model_;
  int shape_count_;
  std::vector<int> vertex_;
  Vertices shaped_, shaped_normals_;        ///< of the whole model
  std::vector<float> rest_, rest_normals_;  ///< of the poser's vertices, x y z x y z ...
  Points3 rest_joints_, bone_vectors_;
  Kinematics kinematics_;
  std::array<std::array<float, 12>, kBones> transform_;     ///< per bone, row-major 3 x 4: rest -> posed
  std::array<Eigen::Vector3f, kDofs> axis_, moment_;        ///< axis_k and axis_k x pivot_k
  std::vector<std::array<std::uint8_t, kSkinBones>> bone_;  ///< by falling weight
  std::vector<std::array<float, kSkinBones>> weight_;
  std::vector<float> directions_;  ///< per vertex: 3 blocks (x, y, z) of shape_stride_ floats
  int shape_stride_;
  std::vector<float> bone_shape_;     ///< per bone: 3 blocks of shape_stride_: d(P_b - A_b J_b)/dbeta
  std::vector<Points3> joint_shape_;  ///< per coefficient: d joint / dbeta, posed
};

}  // namespace booth::fit

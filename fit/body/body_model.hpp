// An individual body: a mesh that follows shape coefficients, a skeleton regressed from it, and skinning that poses both.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "fit/body/skeleton.hpp"

namespace booth::fit {

enum class Sex : std::uint8_t { men, women };
constexpr const char* to_string(Sex s) { return s == Sex::men ? "men" : "women"; }

inline constexpr int kMaxShape = 64;  ///< most shape coefficients a model file may have
inline constexpr int kSkinBones = 4;  ///< most bones that move one vertex
using Vertices = Eigen::Matrix3Xf;    ///< 3 x V, metres
using Faces = Eigen::Matrix3Xi;       ///< 3 x F, counter-clockwise seen from outside
/// Whitened shape coefficients: each in units of its standard deviation. Fixed capacity, so resizing never allocates.
using ShapeVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxShape, 1>;

/// Everything that a model file holds; see docs/reference/model-file.md for its keys. Axes are CMU's (y up, z forward, x left); metres.
struct BodyModelData {
  Sex sex = Sex::men;
  std::string version;         ///< identifies the training run; published with every body
  Vertices mean;               ///< V vertices of the mean body in the A-pose
  Eigen::MatrixXf directions;  ///< 3V x K; column k moves the vertices (x0 y0 z0 x1 ...) by one standard deviation of coefficient k
  Eigen::VectorXd explained;   ///< K; cumulative fraction of the training variance explained by the first k+1 components
  Faces faces;
  Eigen::Matrix<std::uint8_t, kSkinBones, Eigen::Dynamic> skin_bone;
  Eigen::Matrix<float, kSkinBones, Eigen::Dynamic> skin_weight;  ///< >= 0, columns sum to 1; BodyModel sorts them by falling weight; unused entries 0
  Eigen::MatrixXd joint_regressor;                               ///< 24 x V, rows >= 0 and summing to 1
  PoseVector rest_pose = PoseVector::Zero();                     ///< q_rest: the A-pose in CMU angles; translation zero
  Eigen::VectorXi mirror_vertex;                                 ///< V; index of the left/right counterpart
  Eigen::VectorXi landmarks;                                     ///< vertex of each Landmark of fit/body/measure.hpp; empty when the model cannot be measured
};

/// Immutable and thread-safe after construction.
class BodyModel {
 public:
  /// Throws std::invalid_argument, naming the member and what is wrong with its size or values.
  /// The root joint is moved to the origin for every shape, so that q_rest reproduces the shaped mesh exactly.
  explicit BodyModel(BodyModelData data);

  const BodyModelData& data() const { return data_; }
  Sex sex() const { return data_.sex; }
  int vertex_count() const { return static_cast<int>(data_.mean.cols()); }
  int shape_count() const { return static_cast<int>(data_.directions.cols()); }
  const PoseVector& rest_pose() const { return data_.rest_pose; }
  /// Area that each vertex stands for on the mean body (a third of its triangles), m^2.
  const Eigen::VectorXf& vertex_area() const { return vertex_area_; }

  /// Joints of the resting body; beta shorter than shape_count() means zeros behind.
  Points3 rest_joints(const ShapeVector& beta) const;
  /// d rest_joints / d beta_k.
  const Points3& joint_direction(int k) const { return joint_directions_[static_cast<std::size_t>(k)]; }
  /// v_b(beta) = G_b(q_rest)^T (J_end - J_start): what forward_kinematics() takes.
  Points3 bone_vectors(const ShapeVector& beta) const;
  /// The same linear map for any joint set (used for the derivatives too).
  Points3 bone_vectors_from_joints(const Points3& rest_joints) const;
  /// G_b(q_rest).
  const Eigen::Matrix3d& rest_rotation(int bone) const { return rest_rotation_[static_cast<std::size_t>(bone)]; }

  /// Vertices of the resting body, s(beta) of eq. 1. `out` is resized on first use only.
  void shaped(const ShapeVector& beta, Vertices& out) const;
  /// Vertices in pose q: v = sum_b w_b [G_b(q) G_b(q_rest)^T (v_rest - J_b) + P_b(q)].
  void posed(const ShapeVector& beta, const PoseVector& q, Vertices& out) const;
  /// Poses a resting mesh that need not lie in the shape space (test bodies, detail layers), with its own resting joints.
  void pose_mesh(const Vertices& rest, const Points3& rest_joints, const PoseVector& q, Vertices& out) const;

 private:
  BodyModelData data_;
  Eigen::VectorXf vertex_area_;
  Points3 mean_joints_;
  std::vector<Points3> joint_directions_;
  std::array<Eigen::Matrix3d, kBones> rest_rotation_;
};

/// Area-weighted vertex normals of a mesh, unit length (zero where a vertex has no area).
void vertex_normals(const Vertices& vertices, const Faces& faces, Vertices& out);

}  // namespace booth::fit

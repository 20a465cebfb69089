// Checks of model data and the two linear maps (shape, skeleton) plus smooth skinning (MATH.md 2).
#include "fit/body/body_model.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <stdexcept>

namespace booth::fit {
namespace {

void require(bool ok, const std::string& what) {
  if (!ok) throw std::invalid_argument("body model: " + what);
}

void check(const BodyModelData& d) {
  const auto vertices = d.mean.cols();
  const auto sized = [&](const char* name, long have, long want) {
    require(have == want, std::string(name) + " has size " + std::to_string(have) + ", expected " + std::to_string(want));
  };
  require(vertices >= 16 && vertices <= 200000, "v_template has " + std::to_string(vertices) + " vertices, allowed are 16 to 200000");
  require(d.directions.cols() >= 1 && d.directions.cols() <= kMaxShape,
          "shapedirs has " + std::to_string(d.directions.cols()) + " components, allowed are 1 to " + std::to_string(kMaxShape));
  sized("shapedirs", d.directions.rows(), 3 * vertices);
  sized("explained", d.explained.size(), d.directions.cols());
  sized("weights (bones)", d.skin_bone.cols(), vertices);
  sized("weights", d.skin_weight.cols(), vertices);
  sized("J_regressor rows", d.joint_regressor.rows(), kJoints);
  sized("J_regressor columns", d.joint_regressor.cols(), vertices);
  sized("mirror_vertex", d.mirror_vertex.size(), vertices);
  require(d.faces.cols() > 0, "f has no faces");
  require(d.mean.allFinite() && d.directions.allFinite() && d.skin_weight.allFinite() && d.joint_regressor.allFinite() && d.rest_pose.allFinite(),
          "a value is not finite");
  require(d.faces.minCoeff() >= 0 && d.faces.maxCoeff() < vertices, "f names a vertex that does not exist");
  require(d.mirror_vertex.minCoeff() >= 0 && d.mirror_vertex.maxCoeff() < vertices, "mirror_vertex names a vertex that does not exist");
  require(d.skin_bone.maxCoeff() < kBones, "weights name a bone that does not exist");
  require(d.skin_weight.minCoeff() >= 0 && ((d.skin_weight.colwise().sum().array() - 1).abs() < 1e-3f).all(),
          "weights of a vertex are negative or do not sum to 1");
  require(d.joint_regressor.minCoeff() >= -1e-9 && ((d.joint_regressor.rowwise().sum().array() - 1).abs() < 1e-3).all(),
          "a row of J_regressor is negative or does not sum to 1");
  require(d.rest_pose.head<3>().isZero(), "q_rest has a translation");
  require(d.mean.cwiseAbs().maxCoeff() < 10, "v_template is not in metres");
}

}  // namespace

BodyModel::BodyModel(BodyModelData data) : data_(std::move(data)) {
  check(data_);
  // Exactly unit sums, whatever the file's precision was.
  for (int v = 0; v < data_.skin_weight.cols(); ++v) {
    data_.skin_weight.col(v) /= data_.skin_weight.col(v).sum();
    // By falling weight, so that loops over a vertex's bones may stop at the first zero.
    for (int i = 1; i < kSkinBones; ++i)
      for (int j = i; j > 0 && data_.skin_weight(j, v) > data_.skin_weight(j - 1, v); --j) {
        std::swap(data_.skin_weight(j, v), data_.skin_weight(j - 1, v));
        std::swap(data_.skin_bone(j, v), data_.skin_bone(j - 1, v));
      }
  }
  for (int j = 0; j < kJoints; ++j) data_.joint_regressor.row(j) /= data_.joint_regressor.row(j).sum();

  const auto joints_of = [&](const auto& points) -> Points3 { return (data_.joint_regressor * points.template cast<double>().transpose()).transpose(); };
  const auto centre = [&](auto&& vertices, Points3& joints) {
    joints = joints_of(vertices);
    const Eigen::Vector3d root = joints.col(0);
    vertices.colwise() -= root.cast<float>();
    joints.colwise() -= root;
  };
  centre(data_.mean, mean_joints_);
  joint_directions_.resize(static_cast<std::size_t>(shape_count()));
  for (int k = 0; k < shape_count(); ++k) centre(data_.directions.col(k).reshaped(3, vertex_count()), joint_directions_[static_cast<std::size_t>(k)]);

  Kinematics rest;
  forward_kinematics(data_.rest_pose, Points3::Zero(), rest);
  rest_rotation_ = rest.rotation;

  vertex_area_ = Eigen::VectorXf::Zero(vertex_count());
  for (int f = 0; f < data_.faces.cols(); ++f) {
    const auto t = data_.faces.col(f);
    const Eigen::Vector3f a = data_.mean.col(t[0]), b = data_.mean.col(t[1]), c = data_.mean.col(t[2]);
    const float third = (b - a).cross(c - a).norm() / 6;
    for (int i = 0; i < 3; ++i) vertex_area_[t[i]] += third;
  }
}

Points3 BodyModel::rest_joints(const ShapeVector& beta) const {
  Points3 joints = mean_joints_;
  for (int k = 0; k < beta.size(); ++k) joints += beta[k] * joint_directions_[static_cast<std::size_t>(k)];
  return joints;
}

Points3 BodyModel::bone_vectors_from_joints(const Points3& rest_joints) const {
  Points3 v;
  v.col(0).setZero();
  for (int b = 1; b < kBones; ++b) v.col(b) = rest_rotation(b).transpose() * (rest_joints.col(b) - rest_joints.col(bones()[b].parent));
  return v;
}

Points3 BodyModel::bone_vectors(const ShapeVector& beta) const { return bone_vectors_from_joints(rest_joints(beta)); }

void BodyModel::shaped(const ShapeVector& beta, Vertices& out) const {
  out = data_.mean;
  // Column by column, so that the sum has one order on every machine.
  for (int k = 0; k < beta.size(); ++k) out.reshaped() += static_cast<float>(beta[k]) * data_.directions.col(k);
}

void BodyModel::posed(const ShapeVector& beta, const PoseVector& q, Vertices& out) const {
  shaped(beta, out);
  pose_mesh(out, rest_joints(beta), q, out);
}

void BodyModel::pose_mesh(const Vertices& rest, const Points3& rest_joints, const PoseVector& q, Vertices& out) const {
  Kinematics kin;
  forward_kinematics(q, bone_vectors_from_joints(rest_joints), kin);
  // Per bone: x -> A x + t, computed in double, applied in float.
  std::array<Eigen::Matrix3f, kBones> rotation;
  std::array<Eigen::Vector3f, kBones> offset;
  for (int b = 0; b < kBones; ++b) {
    const Eigen::Matrix3d r = kin.rotation[b] * rest_rotation(b).transpose();
    rotation[b] = r.cast<float>();
    offset[b] = (kin.joint.col(start_joint(b)) - r * rest_joints.col(start_joint(b))).cast<float>();
  }
  if (out.cols() != rest.cols()) out.resize(3, rest.cols());
  for (int v = 0; v < rest.cols(); ++v) {
    const Eigen::Vector3f p = rest.col(v);
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (int i = 0; i < kSkinBones; ++i) {
      const float w = data_.skin_weight(i, v);
      if (w == 0) continue;
      const int b = data_.skin_bone(i, v);
      sum += w * (rotation[b] * p + offset[b]);
    }
    out.col(v) = sum;
  }
}

void vertex_normals(const Vertices& vertices, const Faces& faces, Vertices& out) {
  out = Vertices::Zero(3, vertices.cols());
  for (int f = 0; f < faces.cols(); ++f) {
    const auto t = faces.col(f);
    const Eigen::Vector3f a = vertices.col(t[0]);
    const Eigen::Vector3f n = (vertices.col(t[1]) - a).cross(vertices.col(t[2]) - a);
    for (int i = 0; i < 3; ++i) out.col(t[i]) += n;
  }
  for (int v = 0; v < out.cols(); ++v) {
    const float length = out.col(v).norm();
    if (length > 0) out.col(v) /= length;
  }
}

}  // namespace booth::fit

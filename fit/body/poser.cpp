// Linear blend skinning and its exact derivatives (MATH.md 2), vertex by vertex.
#include "fit/body/poser.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>

#include "fit/body/sampling.hpp"
#include "fit/kernel.hpp"

namespace booth::fit {
namespace {

/// Sums the bones' 3 x 4 matrices of one vertex. Each of the 12 lanes by itself: the same bits for any vector width.
inline void blend(const std::array<std::array<float, 12>, kBones>& transform, const std::array<std::uint8_t, kSkinBones>& bone,
                  const std::array<float, kSkinBones>& weight, float* m) {
  const float* t0 = transform[bone[0]].data();
  for (int j = 0; j < 12; ++j) m[j] = weight[0] * t0[j];
  for (int k = 1; k < kSkinBones && weight[k] > 0; ++k) {
    const float* t = transform[bone[k]].data();
    for (int j = 0; j < 12; ++j) m[j] += weight[k] * t[j];
  }
}

/// row[j] += x a[j] + y a[stride + j] + z a[2 stride + j], lane by lane.
BOOTH_KERNEL void add_directions(const float* a, int stride, int n, float x, float y, float z, float* row) {
  for (int j = 0; j < n; ++j) row[j] += x * a[j] + y * a[stride + j] + z * a[2 * stride + j];
}

}  // namespace

Poser::Poser(const BodyModel& model, int shape_count, int vertex_count)
    : model_(&model),
      shape_count_(std::min(shape_count, model.shape_count())),
      vertex_(spread_vertices(model, vertex_count)),
      shape_stride_((shape_count_ + 7) / 8 * 8) {
  const std::size_t n = vertex_.size();
  for (auto* a : {&x, &y, &z, &nx, &ny, &nz}) a->resize(n);
  bone_.resize(n);
  weight_.resize(n);
  directions_.assign(n * 3 * static_cast<std::size_t>(shape_stride_), 0);
  bone_shape_.assign(static_cast<std::size_t>(kBones * 3 * shape_stride_), 0);
  joint_shape_.resize(static_cast<std::size_t>(shape_count_));
  const BodyModelData& d = model.data();
  for (std::size_t v = 0; v < n; ++v) {
    const auto column = static_cast<Eigen::Index>(vertex_[v]);
    for (int k = 0; k < kSkinBones; ++k) {
      weight_[v][k] = d.skin_weight(k, column);
      bone_[v][k] = d.skin_bone(k, column);
    }
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < shape_count_; ++k) directions_[(v * 3 + c) * shape_stride_ + k] = d.directions(3 * column + c, k);
  }
  rest_.resize(3 * n);
  rest_normals_.resize(3 * n);
  shaped_ = d.mean;
  shaped_normals_ = d.mean;
  set_shape(ShapeVector::Zero(0));
  set_pose(model.rest_pose());
}

BOOTH_KERNEL void Poser::set_shape(const ShapeVector& beta) {
  const int count = std::min<int>(static_cast<int>(beta.size()), shape_count_);
  rest_joints_ = model_->rest_joints(beta.head(count));
  bone_vectors_ = model_->bone_vectors_from_joints(rest_joints_);
  const BodyModelData& d = model_->data();
  const Eigen::Index values = d.mean.size();
  float* out = shaped_.data();
  std::copy_n(d.mean.data(), values, out);
  for (int k = 0; k < count; ++k) {
    const float b = static_cast<float>(beta[k]);
    const float* direction = d.directions.data() + k * values;
    for (Eigen::Index i = 0; i < values; ++i) out[i] += b * direction[i];
  }
  vertex_normals(shaped_, d.faces, shaped_normals_);
  for (int i = 0; i < size(); ++i) {
    std::copy_n(shaped_.data() + 3 * vertex_[i], 3, rest_.data() + 3 * i);
    std::copy_n(shaped_normals_.data() + 3 * vertex_[i], 3, rest_normals_.data() + 3 * i);
  }
}

BOOTH_KERNEL void Poser::set_pose(const PoseVector& q) {
  forward_kinematics(q, bone_vectors_, kinematics_);
  for (int b = 0; b < kBones; ++b) {
    const Eigen::Matrix3d r = kinematics_.rotation[b] * model_->rest_rotation(b).transpose();
    const Eigen::Vector3d t = kinematics_.joint.col(start_joint(b)) - r * rest_joints_.col(start_joint(b));
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) transform_[b][4 * row + column] = static_cast<float>(r(row, column));
      transform_[b][4 * row + 3] = static_cast<float>(t[row]);
    }
  }
  for (int k = 0; k < kDofs; ++k) {
    axis_[k] = kinematics_.axis.col(k).cast<float>();
    moment_[k] = kinematics_.axis.col(k).cross(kinematics_.pivot.col(k)).cast<float>();
  }
  const int n = size();
  for (int i = 0; i < n; ++i) {
    float m[12];
    blend(transform_, bone_[i], weight_[i], m);
    const float* p = rest_.data() + 3 * i;
    const float* r = rest_normals_.data() + 3 * i;
    x[i] = m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3];
    y[i] = m[4] * p[0] + m[5] * p[1] + m[6] * p[2] + m[7];
    z[i] = m[8] * p[0] + m[9] * p[1] + m[10] * p[2] + m[11];
    const float a = m[0] * r[0] + m[1] * r[1] + m[2] * r[2];
    const float b = m[4] * r[0] + m[5] * r[1] + m[6] * r[2];
    const float c = m[8] * r[0] + m[9] * r[1] + m[10] * r[2];
    const float inverse = 1.0f / std::sqrt(std::max(a * a + b * b + c * c, 1e-20f));
    nx[i] = a * inverse, ny[i] = b * inverse, nz[i] = c * inverse;
  }
}

void Poser::prepare_shape_derivatives() {
  for (int k = 0; k < shape_count_; ++k) {
    const Points3& rest = model_->joint_direction(k);
    const Points3 vectors = model_->bone_vectors_from_joints(rest);
    Points3& posed = joint_shape_[k];
    posed.col(0).setZero();
    for (int b = 1; b < kBones; ++b) posed.col(b) = posed.col(bones()[b].parent) + kinematics_.rotation[b] * vectors.col(b);
    for (int b = 0; b < kBones; ++b) {
      const int s = start_joint(b);
      const Eigen::Vector3d u = posed.col(s) - kinematics_.rotation[b] * (model_->rest_rotation(b).transpose() * rest.col(s));
      for (int c = 0; c < 3; ++c) bone_shape_[(b * 3 + c) * shape_stride_ + k] = static_cast<float>(u[c]);
    }
  }
}

void Poser::pose_row(int i, const Eigen::Vector3f& d, float* row) const {
  row[0] += d.x(), row[1] += d.y(), row[2] += d.z();
  const float* p = rest_.data() + 3 * i;
  for (int k = 0; k < kSkinBones; ++k) {
    const float w = weight_[i][k];
    if (w <= 0) break;
    const int b = bone_[i][k];
    const float* m = transform_[b].data();
    const Eigen::Vector3f position(m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3], m[4] * p[0] + m[5] * p[1] + m[6] * p[2] + m[7],
                                   m[8] * p[0] + m[9] * p[1] + m[10] * p[2] + m[11]);
    // d . (axis x (position - pivot)) = axis . (position x d) - (axis x pivot) . d
    const Eigen::Vector3f torque = w * position.cross(d);
    const Eigen::Vector3f force = w * d;
    for (std::uint64_t rest = dof_mask(b) >> 3; rest != 0; rest &= rest - 1) {
      const int dof = std::countr_zero(rest) + 3;
      row[dof] += axis_[dof].dot(torque) - moment_[dof].dot(force);
    }
  }
}

void Poser::shape_row(int i, const Eigen::Vector3f& d, float* row) const {
  Eigen::Vector3f local = Eigen::Vector3f::Zero();  // the direction seen from the resting body
  const int n = shape_count_;
  for (int k = 0; k < kSkinBones; ++k) {
    const float w = weight_[i][k];
    if (w <= 0) break;
    const int b = bone_[i][k];
    const float* m = transform_[b].data();
    const Eigen::Vector3f s = w * d;
    for (int c = 0; c < 3; ++c) local[c] += m[c] * s[0] + m[4 + c] * s[1] + m[8 + c] * s[2];
    const float* u = bone_shape_.data() + b * 3 * shape_stride_;
    add_directions(u, shape_stride_, n, s[0], s[1], s[2], row);
  }
  const float* g = directions_.data() + static_cast<std::size_t>(i) * 3 * shape_stride_;
  add_directions(g, shape_stride_, n, local[0], local[1], local[2], row);
}

std::size_t Poser::memory_bytes() const {
  const std::size_t vertices = vertex_.size();
  return sizeof(*this) + vertices * (sizeof(int) + 12 * sizeof(float) + sizeof(bone_[0]) + sizeof(weight_[0])) +
         (directions_.size() + bone_shape_.size() + static_cast<std::size_t>(shaped_.size() + shaped_normals_.size())) * sizeof(float) +
         joint_shape_.size() * sizeof(Points3);
}

Eigen::Matrix<double, 3, kDofs> Poser::joint_pose_jacobian(int joint) const {
  Eigen::Matrix<double, 3, kDofs> j = Eigen::Matrix<double, 3, kDofs>::Zero();
  j.leftCols<3>().setIdentity();
  const Eigen::Vector3d p = kinematics_.joint.col(joint);
  // The end of a bone moves with the bone's own angles.
  for (std::uint64_t rest = dof_mask(joint) >> 3; rest != 0; rest &= rest - 1) {
    const int dof = std::countr_zero(rest) + 3;
    j.col(dof) = kinematics_.axis.col(dof).cross(p - kinematics_.pivot.col(dof));
  }
  return j;
}

}  // namespace booth::fit

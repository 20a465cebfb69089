// Normals follow the shape to first order: n(beta) = n + sum beta_k dn/dbeta_k, so that eq. 6 uses the normal at (q, beta).
#include "tests/fit/swarm/reference_energy.hpp"

#include <algorithm>
#include <cmath>

#include "fit/body/sampling.hpp"

namespace booth::tests {
namespace {

constexpr int kLanes = 16;

/// out[6 * 16] = block + sum_k beta_k * (block + (k + 1) * 6 * 16), lane by lane.
void shape_group(const float* block, const float* beta, int count, float* out) {
  for (int i = 0; i < 6 * kLanes; ++i) out[i] = block[i];
  for (int k = 0; k < count; ++k) {
    const float b = beta[k];
    const float* direction = block + (k + 1) * 6 * kLanes;
    for (int i = 0; i < 6 * kLanes; ++i) out[i] += b * direction[i];
  }
}

}  // namespace

ReferenceEnergy::ReferenceEnergy(const BodyModel& model, const PosePrior& prior, int shape_count, int vertex_count, PaperWeights weights)
    : model_(model), prior_(prior), weights_(weights), shape_count_(std::min(shape_count, model.shape_count())) {
  const std::vector<int> vertices = spread_vertices(model, vertex_count);
  count_ = static_cast<int>(vertices.size()) / kLane * kLane;
  const std::size_t block = static_cast<std::size_t>(6 * kLane * (1 + shape_count_));
  shape_.assign(block * static_cast<std::size_t>(count_ / kLane), 0);
  bone_.resize(static_cast<std::size_t>(count_ * kSkinBones));
  weight_.resize(bone_.size());

  const BodyModelData& d = model.data();
  Vertices shaped, mean_normals, normals;
  vertex_normals(d.mean, d.faces, mean_normals);
  const auto store = [&](int part, const auto& position, const auto& normal) {
    for (int i = 0; i < count_; ++i)
      for (int c = 0; c < 3; ++c) {
        float* group = shape_.data() + static_cast<std::size_t>(i / kLane) * block + static_cast<std::size_t>(part * 6 * kLane + i % kLane);
        group[c * kLane] = position(c, vertices[static_cast<std::size_t>(i)]);
        group[(3 + c) * kLane] = normal(c, vertices[static_cast<std::size_t>(i)]);
      }
  };
  store(0, d.mean, mean_normals);
  for (int k = 0; k < shape_count_; ++k) {
    // Central difference over one standard deviation to either side: the secant that fits real bodies best.
    const auto direction = d.directions.col(k).reshaped(3, model.vertex_count());
    shaped = d.mean + direction;
    vertex_normals(shaped, d.faces, normals);
    Vertices difference = normals;
    shaped = d.mean - direction;
    vertex_normals(shaped, d.faces, normals);
    difference = 0.5f * (difference - normals);
    store(k + 1, direction, difference);
  }
  for (int i = 0; i < count_; ++i)
    for (int k = 0; k < kSkinBones; ++k) {
      bone_[static_cast<std::size_t>(i * kSkinBones + k)] = d.skin_bone(k, vertices[static_cast<std::size_t>(i)]);
      weight_[static_cast<std::size_t>(i * kSkinBones + k)] = d.skin_weight(k, vertices[static_cast<std::size_t>(i)]);
    }
}

ReferenceEnergy::Terms ReferenceEnergy::evaluate(const float* particle) const {
  PoseVector q;
  for (int i = 0; i < kDofs; ++i) q[i] = static_cast<double>(particle[i]);
  ShapeVector beta(shape_count_);
  for (int k = 0; k < shape_count_; ++k) beta[k] = static_cast<double>(particle[kDofs + k]);

  const Points3 rest_joints = model_.rest_joints(beta);
  const Points3 vectors = model_.bone_vectors_from_joints(rest_joints);
  Kinematics kinematics;
  forward_kinematics(q, vectors, kinematics);
  float transform[kBones][12];
  for (int b = 0; b < kBones; ++b) {
    const Eigen::Matrix3d r = kinematics.rotation[b] * model_.rest_rotation(b).transpose();
    const Eigen::Vector3d t = kinematics.joint.col(start_joint(b)) - r * rest_joints.col(start_joint(b));
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) transform[b][4 * row + column] = static_cast<float>(r(row, column));
      transform[b][4 * row + 3] = static_cast<float>(t[row]);
    }
  }

  float point = 0, plane = 0, at_edge = 0;
  const std::size_t block = static_cast<std::size_t>(6 * kLane * (1 + shape_count_));
  for (int group = 0; group < count_ / kLane; ++group) {
    float rest[6 * kLane];
    shape_group(shape_.data() + static_cast<std::size_t>(group) * block, particle + kDofs, shape_count_, rest);
    for (int lane = 0; lane < kLane; ++lane) {
      const std::size_t at = static_cast<std::size_t>((group * kLane + lane) * kSkinBones);
      float m[12];
      for (int j = 0; j < 12; ++j) m[j] = weight_[at] * transform[bone_[at]][j];
      for (int k = 1; k < kSkinBones && weight_[at + static_cast<std::size_t>(k)] > 0; ++k)
        for (int j = 0; j < 12; ++j) m[j] += weight_[at + static_cast<std::size_t>(k)] * transform[bone_[at + static_cast<std::size_t>(k)]][j];
      const float x = rest[lane], y = rest[kLane + lane], z = rest[2 * kLane + lane];
      const Eigen::Vector3f v(m[0] * x + m[1] * y + m[2] * z + m[3], m[4] * x + m[5] * y + m[6] * z + m[7], m[8] * x + m[9] * y + m[10] * z + m[11]);
      const float a = rest[3 * kLane + lane], b = rest[4 * kLane + lane], c = rest[5 * kLane + lane];
      const Eigen::Vector3f n(m[0] * a + m[1] * b + m[2] * c, m[4] * a + m[5] * b + m[6] * c, m[8] * a + m[9] * b + m[10] * c);
      const auto off_plane = [&](const Eigen::Vector3f& from, const Eigen::Vector3f& to) {
        return std::abs(n.dot(from - to)) / std::sqrt(std::max(n.squaredNorm(), 1e-12f));
      };
      Eigen::Vector3f nearest, beside;
      const bool inside = field_->nearest(v, nearest);
      const float charged = inside ? off_plane(v, nearest) : kOutside;
      point += inside ? (v - nearest).norm() : kOutside;
      plane += charged;
      float jump = 0;
      for (int i = 0; i < 6; ++i) {
        const Eigen::Vector3f moved = v + (i % 2 == 0 ? kEdge : -kEdge) * Eigen::Vector3f::Unit(i / 2);
        const bool still = field_->nearest(moved, beside);
        if (still != inside) jump = std::max(jump, std::abs((still ? off_plane(moved, beside) : kOutside) - charged));
      }
      at_edge += jump;
    }
  }

  const double scale = kMillimetres * kPaperVertices / count_;
  return {static_cast<double>(point) * scale,  static_cast<double>(plane) * scale, shape_energy(beta), bone_energy(vectors), pose_energy(prior_, q),
          static_cast<double>(at_edge) * scale};
}

}  // namespace booth::tests

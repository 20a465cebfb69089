// Figures are made on at most 2,000 points of the cloud and 2,000 evenly spread vertices.
#include "fit/track/diagnostics.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "fit/cloud/projection.hpp"
#include "fit/track/joint_uncertainty.hpp"

namespace booth::fit {
namespace {

constexpr float kFar = 0.5f;         // m; beyond, a point does not belong to the body at all
constexpr float kExplained = 0.04f;  // m; a vertex with a cloud point so near was seen
constexpr int kSeenPoints = 4;       // of 2,000 on a joint's bones make it seen

DistanceStatistics statistics(std::vector<float>& values, int count) {
  DistanceStatistics s;
  if (count == 0) return s;
  double sum = 0;
  for (int i = 0; i < count; ++i) sum += static_cast<double>(values[static_cast<std::size_t>(i)]);
  std::sort(values.begin(), values.begin() + count);
  s.mean = sum / count;
  s.median = static_cast<double>(values[static_cast<std::size_t>(count / 2)]);
  s.p95 = static_cast<double>(values[static_cast<std::size_t>(count * 95 / 100)]);
  return s;
}

}  // namespace

Diagnostics::Diagnostics(const BodyModel& model)
    : poser_(model, model.shape_count(), model.vertex_count()),
      body_(model.vertex_count()),
      cloud_(kSamples),
      vertices_(3, model.vertex_count()),
      surface_(model.data().faces, model.vertex_count()) {
  surface_.set(model.data().mean);  // so that it grows now
  for (auto* a : {&distance_, &x_, &y_, &z_, &nx_, &ny_, &nz_}) a->resize(kSamples);
}

std::size_t Diagnostics::memory_bytes() const {
  return sizeof(*this) - sizeof(poser_) - sizeof(surface_) + poser_.memory_bytes() + surface_.memory_bytes() + body_.memory_bytes() + cloud_.memory_bytes() +
         static_cast<std::size_t>(vertices_.size()) * sizeof(float) + 7 * kSamples * sizeof(float);
}

void Diagnostics::describe(const Observation& observation, bool exact, FitResult& result) {
  poser_.set_shape(result.beta);
  poser_.set_pose(result.q);
  for (int i = 0; i < poser_.size(); ++i) vertices_.col(poser_.model_vertex(i)) = poser_.position(i);
  result.joints = poser_.kinematics().joint;
  for (int b = 0; b < kBones; ++b) result.bone_rotation[b] = Eigen::Quaterniond(poser_.kinematics().rotation[b]);

  const Cloud& cloud = observation.cloud;
  const int count = std::min(kSamples, cloud.size);
  body_.rebuild(poser_.x.data(), poser_.y.data(), poser_.z.data(), poser_.nx.data(), poser_.ny.data(), poser_.nz.data(), poser_.size());
  std::array<int, kBones> seen{};
  if (exact) surface_.set(vertices_);
  for (int s = 0; s < count; ++s) {
    const auto i = static_cast<std::size_t>(static_cast<std::int64_t>(s) * cloud.size / count), o = static_cast<std::size_t>(s);
    x_[o] = cloud.x[i], y_[o] = cloud.y[i], z_[o] = cloud.z[i];
    nx_[o] = cloud.nx[i], ny_[o] = cloud.ny[i], nz_[o] = cloud.nz[i];
    const Eigen::Vector3f p(x_[o], y_[o], z_[o]);
    const int v = body_.nearest(p, kFar);
    float distance = kFar;
    if (v >= 0) {
      const Eigen::Vector3f difference = p - poser_.position(v);
      const float along = difference.dot(poser_.normal(v));
      const float across2 = difference.squaredNorm() - along * along;
      // The tangent plane is as good as the surface within a vertex's own patch.
      distance = exact                       ? surface_.distance(p)
                 : across2 < 0.015f * 0.015f ? std::abs(along)
                                             : std::min(difference.norm(), std::sqrt(along * along + across2 * 0.25f));
      if (distance < kExplained && (result.unseen >> poser_.main_bone(v) & 1u) == 0) ++seen[static_cast<std::size_t>(poser_.main_bone(v))];
    }
    distance_[o] = distance;
  }
  result.cloud_to_model = statistics(distance_, count);
  for (int j = 0; j < kJoints; ++j) {
    // A joint lies between the bone that ends there and the bones that start there.
    int points = seen[static_cast<std::size_t>(j)];
    for (int b = 1; b < kBones; ++b)
      if (bones()[b].parent == j) points += seen[static_cast<std::size_t>(b)];
    if (j > 0 && dof_mask(j) == dof_mask(bones()[j].parent))
      points += seen[static_cast<std::size_t>(bones()[j].parent)];  // a bone that does not turn moves with its parent
    result.visibility[static_cast<std::size_t>(j)] = points >= kSeenPoints ? JointVisibility::seen : JointVisibility::inferred;
  }

  cloud_.rebuild(x_.data(), y_.data(), z_.data(), nx_.data(), ny_.data(), nz_.data(), count);
  const int vertices = std::min(kSamples, poser_.size());
  int covered = 0, visible = 0;
  for (int s = 0; s < vertices; ++s) {
    const int c = cloud_.nearest(poser_.position(s), kFar);
    if (c < 0) continue;
    const auto o = static_cast<std::size_t>(c);
    const Eigen::Vector3f difference = poser_.position(s) - Eigen::Vector3f(x_[o], y_[o], z_[o]);
    const Eigen::Vector3f normal(nx_[o], ny_[o], nz_[o]);
    if (!normal.isZero() && normal.dot(poser_.normal(s)) < 0) continue;  // the other side of the body
    covered += difference.norm() < kExplained;
    // The sample is sparse: what lies along the surface is the distance between samples, not an error.
    const float along = std::abs(difference.dot(poser_.normal(s)));
    distance_[static_cast<std::size_t>(visible++)] = difference.norm() < kExplained ? along : difference.norm();
  }
  result.coverage = vertices > 0 ? static_cast<double>(covered) / vertices : 0.0;
  result.model_to_cloud = statistics(distance_, visible);
}

void Diagnostics::covariance(const UnknownMatrix& information, const UnknownMatrix& shape_information, FitResult& result) const {
  const auto inverse_of = [](UnknownMatrix m) {
    m.diagonal().array() += 1e-6;
    return UnknownMatrix(m.ldlt().solve(UnknownMatrix::Identity(m.rows(), m.cols())));
  };
  const UnknownMatrix inverse = inverse_of(information);
  const Eigen::Index shape = information.rows() - kDofs;
  const UnknownMatrix known = shape > 0 ? UnknownMatrix(inverse.bottomRightCorner(shape, shape)) : inverse_of(shape_information);
  const double factor = one_side_factor(result.coverage);
  result.shape_covariance = 0.5 * factor * factor * (known + known.transpose());
  for (int j = 0; j < kJoints; ++j) {
    const Eigen::Matrix<double, 3, kDofs> jacobian = poser_.joint_pose_jacobian(j);
    const Eigen::Matrix3d c = jacobian * inverse.topLeftCorner<kDofs, kDofs>() * jacobian.transpose();
    result.joint_covariance[static_cast<std::size_t>(j)] =
        calibrated_joint_covariance(0.5 * (c + c.transpose()), j, result.visibility[static_cast<std::size_t>(j)], result.coverage);
  }
}

}  // namespace booth::fit

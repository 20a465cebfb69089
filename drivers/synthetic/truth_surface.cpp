// Skinning from plain values, so that a recording carries all its surface needs.
#include "drivers/synthetic/truth_surface.hpp"

#include "fit/body/skeleton.hpp"

namespace booth::drivers {

static_assert(kTruthBones == fit::kBones && kTruthSkinBones == fit::kSkinBones);

TruthBody truth_body(const Person& person) {
  const auto& d = person.model->data();
  TruthBody body;
  body.name = person.name;
  body.sex = fit::to_string(person.model->sex());
  body.beta.assign(person.beta.begin(), person.beta.end());
  std::copy(d.rest_pose.begin(), d.rest_pose.end(), body.rest_pose.begin());
  for (int j = 0; j < fit::kJoints; ++j)
    for (int i = 0; i < 3; ++i) body.rest_joints[static_cast<std::size_t>(j)][static_cast<std::size_t>(i)] = person.rest_joints(i, j);
  for (int v = 0; v < person.rest.cols(); ++v) {
    body.vertices.push_back({person.rest(0, v), person.rest(1, v), person.rest(2, v)});
    body.bones.emplace_back();
    body.weights.emplace_back();
    for (int i = 0; i < kTruthSkinBones; ++i) {
      body.bones.back()[static_cast<std::size_t>(i)] = d.skin_bone(i, v);
      body.weights.back()[static_cast<std::size_t>(i)] = d.skin_weight(i, v);
    }
  }
  for (int f = 0; f < d.faces.cols(); ++f) body.faces.push_back({d.faces(0, f), d.faces(1, f), d.faces(2, f)});
  return body;
}

std::vector<std::array<float, 3>> truth_surface(const TruthBody& body, const std::array<double, 36>& q) {
  fit::Kinematics rest, posed;
  fit::forward_kinematics(Eigen::Map<const fit::PoseVector>(body.rest_pose.data()), fit::Points3::Zero(), rest);
  const fit::Points3 joints = Eigen::Map<const fit::Points3>(body.rest_joints.front().data());
  fit::Points3 vectors = fit::Points3::Zero();
  for (int b = 1; b < fit::kBones; ++b) vectors.col(b) = rest.rotation[b].transpose() * (joints.col(b) - joints.col(fit::start_joint(b)));
  fit::forward_kinematics(Eigen::Map<const fit::PoseVector>(q.data()), vectors, posed);
  std::array<Eigen::Matrix3f, fit::kBones> rotation;
  std::array<Eigen::Vector3f, fit::kBones> offset;
  for (int b = 0; b < fit::kBones; ++b) {
    const Eigen::Matrix3d r = posed.rotation[b] * rest.rotation[b].transpose();
    rotation[b] = r.cast<float>();
    offset[b] = (posed.joint.col(fit::start_joint(b)) - r * joints.col(fit::start_joint(b))).cast<float>();
  }
  std::vector<std::array<float, 3>> out;
  out.reserve(body.vertices.size());
  for (std::size_t v = 0; v < body.vertices.size(); ++v) {
    const Eigen::Vector3f p(body.vertices[v].data());
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (std::size_t i = 0; i < kTruthSkinBones; ++i) {
      const auto b = static_cast<std::size_t>(body.bones[v][i]);
      if (const float w = body.weights[v][i]; w > 0) sum += w * (rotation[b] * p + offset[b]);
    }
    out.push_back({sum.z(), sum.x(), sum.y()});
  }
  return out;
}

}  // namespace booth::drivers

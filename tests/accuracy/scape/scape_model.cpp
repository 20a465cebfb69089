// Training: 70 posed templates for the pose part, bodies drawn from the shape space for the shape part.
#include "tests/accuracy/scape/scape_model.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "fit/train/pca.hpp"
#include "fit/train/random.hpp"

namespace booth::accuracy {
namespace {

constexpr float kRidge = 0.05f;             // on the twists' coefficients, in squared radians summed over the templates
constexpr float kMostRestored = 0.03f;      // m that a vertex may be moved to restore a joint's volume
constexpr std::uint64_t kShapeSeed = 2005;  // of the bodies that the shape part is trained on

Eigen::Vector3f twist(const Eigen::Matrix3f& from, const Eigen::Matrix3f& to) {
  const Eigen::AngleAxisf a(Eigen::Matrix3f(from.transpose() * to));
  return a.angle() * a.axis();
}

/// Weight of `bone` on a vertex.
float weight_of(const fit::BodyModelData& d, int bone, Eigen::Index v) {
  float sum = 0;
  for (int k = 0; k < fit::kSkinBones; ++k)
    if (d.skin_bone(k, v) == bone) sum += d.skin_weight(k, v);
  return sum;
}

}  // namespace

Eigen::Matrix3f triangle_deformation(const Eigen::Vector3f& a1, const Eigen::Vector3f& a2, const Eigen::Vector3f& b1, const Eigen::Vector3f& b2) {
  const Eigen::Vector3f an = a1.cross(a2), bn = b1.cross(b2);
  Eigen::Matrix3f a, b;
  // A normal as long as the root of the area scales with the triangle.
  a << a1, a2, an / std::sqrt(std::max(an.norm(), 1e-12f));
  b << b1, b2, bn / std::sqrt(std::max(bn.norm(), 1e-12f));
  const float determinant = a.determinant();
  if (std::abs(determinant) < 1e-14f) return Eigen::Matrix3f::Identity();
  return b * a.inverse();
}

ScapeModel::ScapeModel(const fit::BodyModel& model, const fit::PosePrior& prior) : model_(model), template_(model.data().mean) {
  find_parts();
  train_pose(prior);
  train_shape();
}

void ScapeModel::find_parts() {
  const auto& d = model_.data();
  std::array<bool, fit::kBones> used{};
  for (Eigen::Index f = 0; f < d.faces.cols(); ++f) {
    std::array<float, fit::kBones> sum{};
    for (int k = 0; k < 3; ++k)
      for (int b = 0; b < fit::kSkinBones; ++b) sum[d.skin_bone(b, d.faces(k, f))] += d.skin_weight(b, d.faces(k, f));
    const int part = static_cast<int>(std::max_element(sum.begin(), sum.end()) - sum.begin());
    part_.push_back(part);
    used[static_cast<std::size_t>(part)] = true;
  }
  for (int b = 1; b < fit::kBones; ++b) {
    if (!used[static_cast<std::size_t>(b)]) continue;
    int parent = fit::bones()[static_cast<std::size_t>(b)].parent;
    while (parent > 0 && !used[static_cast<std::size_t>(parent)]) parent = fit::bones()[static_cast<std::size_t>(parent)].parent;
    for (const int p : {b, std::max(parent, 0)})
      if (static_cast<int>(joints_[static_cast<std::size_t>(p)].size()) < kMostTwists)
        joints_[static_cast<std::size_t>(p)].emplace_back(std::max(parent, 0), b);
  }
}

ScapeModel::Features ScapeModel::features(int part, const Rotations& rotations) const {
  Features out = Features::Zero();
  int at = 0;
  for (const auto& [parent, child] : joints_[static_cast<std::size_t>(part)]) {
    out.segment<3>(3 * at++) = twist(rotations[static_cast<std::size_t>(parent)], rotations[static_cast<std::size_t>(child)]);
  }
  out[kFeatures - 1] = 1;
  return out;
}

fit::Vertices ScapeModel::posed_template(const fit::PoseVector& q, Rotations& rotations) const {
  const auto& d = model_.data();
  const fit::Points3 joints = model_.rest_joints(fit::ShapeVector::Zero(model_.shape_count()));
  fit::Kinematics kin;
  fit::forward_kinematics(q, model_.bone_vectors_from_joints(joints), kin);
  for (int b = 0; b < fit::kBones; ++b)
    rotations[static_cast<std::size_t>(b)] = (kin.rotation[static_cast<std::size_t>(b)] * model_.rest_rotation(b).transpose()).cast<float>();
  fit::Vertices v, normals;
  model_.pose_mesh(template_, joints, q, v);
  fit::vertex_normals(v, d.faces, normals);
  // Linear blending lets joints shrink. The cone over a joint's skin from the joint itself has the same volume in every pose, because its rims move rigidly
  // with the two bones: the skin between them is moved along its normals until that holds.
  for (int b = 1; b < fit::kBones; ++b) {
    const int parent = fit::bones()[static_cast<std::size_t>(b)].parent;
    Eigen::VectorXf blend(v.cols());
    for (Eigen::Index i = 0; i < v.cols(); ++i) blend[i] = 4 * weight_of(d, b, i) * weight_of(d, parent, i);
    if (blend.maxCoeff() < 0.1f) continue;
    const Eigen::Vector3f rest_joint = joints.col(fit::start_joint(b)).cast<float>(), joint = kin.joint.col(fit::start_joint(b)).cast<float>();
    float rest_volume = 0, volume = 0, gain = 0;
    for (Eigen::Index f = 0; f < d.faces.cols(); ++f) {
      const auto t = d.faces.col(f);
      const float moved = blend[t[0]] + blend[t[1]] + blend[t[2]];
      if (moved <= 0) continue;
      const auto cone = [&](const fit::Vertices& x, const Eigen::Vector3f& apex) {
        return (x.col(t[0]) - apex).dot((x.col(t[1]) - apex).cross(x.col(t[2]) - apex)) / 6;
      };
      rest_volume += cone(template_, rest_joint);
      volume += cone(v, joint);
      gain += moved / 3 * (v.col(t[1]) - v.col(t[0])).cross(v.col(t[2]) - v.col(t[0])).norm() / 2;
    }
    if (gain < 1e-6f) continue;
    const float along = std::clamp((rest_volume - volume) / gain, -kMostRestored, kMostRestored);
    for (Eigen::Index i = 0; i < v.cols(); ++i) v.col(i) += along * blend[i] * normals.col(i);
  }
  return v;
}

void ScapeModel::train_pose(const fit::PosePrior& prior) {
  const auto& faces = model_.data().faces;
  const auto n = static_cast<std::size_t>(triangles());
  using Normal = Eigen::Matrix<float, kFeatures, kFeatures>;
  std::array<Normal, fit::kBones> normal;
  normal.fill(kRidge * Normal::Identity());
  std::vector<Eigen::Matrix<float, 9, kFeatures>> right(n, Eigen::Matrix<float, 9, kFeatures>::Zero());
  const int templates = std::min<int>(kTemplates, static_cast<int>(prior.exemplars.cols()));
  for (int k = 0; k < templates; ++k) {
    Rotations rotations;
    const fit::Vertices v = posed_template(prior.exemplars.col(k), rotations);
    std::array<Features, fit::kBones> feature;
    for (int p = 0; p < fit::kBones; ++p) {
      const auto i = static_cast<std::size_t>(p);
      feature[i] = features(p, rotations);
      normal[i] += feature[i] * feature[i].transpose();
    }
    for (std::size_t t = 0; t < n; ++t) {
      const auto f = faces.col(static_cast<Eigen::Index>(t));
      const auto p = static_cast<std::size_t>(part_[t]);
      const Eigen::Matrix3f back = rotations[p].transpose();
      const Eigen::Matrix3f q = triangle_deformation(edge(static_cast<int>(t), 0), edge(static_cast<int>(t), 1), back * (v.col(f[1]) - v.col(f[0])),
                                                     back * (v.col(f[2]) - v.col(f[0])));
      // What is regressed is the difference from no deformation, so that the ridge pulls there.
      const Eigen::Matrix3f off = q - Eigen::Matrix3f::Identity();
      right[t] += Eigen::Map<const Eigen::Matrix<float, 9, 1>>(off.data()) * feature[p].transpose();
    }
  }
  std::array<Normal, fit::kBones> inverse;
  for (std::size_t p = 0; p < inverse.size(); ++p) inverse[p] = normal[p].ldlt().solve(Normal::Identity());
  regression_.resize(n);
  for (std::size_t t = 0; t < n; ++t) regression_[t] = right[t] * inverse[static_cast<std::size_t>(part_[t])];
}

void ScapeModel::train_shape() {
  const auto& faces = model_.data().faces;
  Eigen::MatrixXf all(9 * triangles(), kShapeBodies);
  fit::train::Random random(kShapeSeed, model_.sex() == fit::Sex::men ? 0 : 1);
  fit::Vertices v;
  for (int body = 0; body < kShapeBodies; ++body) {
    fit::ShapeVector beta(model_.shape_count());
    for (auto& b : beta) b = random.normal();
    model_.shaped(beta, v);
    for (int t = 0; t < triangles(); ++t) {
      const auto f = faces.col(t);
      const Eigen::Matrix3f s = triangle_deformation(edge(t, 0), edge(t, 1), v.col(f[1]) - v.col(f[0]), v.col(f[2]) - v.col(f[0]));
      all.block<9, 1>(9 * t, body) = Eigen::Map<const Eigen::Matrix<float, 9, 1>>(s.data());
    }
  }
  shape_mean_ = all.rowwise().mean();
  all.colwise() -= shape_mean_;
  const auto components = fit::train::principal_components(all, kShapes);
  shape_ = components.direction;
  for (Eigen::Index k = 0; k < shape_.cols(); ++k) shape_.col(k) *= static_cast<float>(std::sqrt(components.variance[k]));
}

void ScapeModel::pose_deformations(const Rotations& rotations, Deformations& out) const {
  std::array<Features, fit::kBones> feature;
  for (int p = 0; p < fit::kBones; ++p) feature[static_cast<std::size_t>(p)] = features(p, rotations);
  out.resize(part_.size());
  for (std::size_t t = 0; t < part_.size(); ++t) {
    const Eigen::Matrix<float, 9, 1> off = regression_[t] * feature[static_cast<std::size_t>(part_[t])];
    out[t] = Eigen::Matrix3f::Identity() + Eigen::Map<const Eigen::Matrix3f>(off.data());
  }
}

Eigen::Matrix3f ScapeModel::shape_mean(int triangle) const { return Eigen::Map<const Eigen::Matrix3f>(shape_mean_.data() + 9 * triangle); }
Eigen::Matrix3f ScapeModel::shape_direction(int triangle, int k) const { return Eigen::Map<const Eigen::Matrix3f>(shape_.col(k).data() + 9 * triangle); }

}  // namespace booth::accuracy

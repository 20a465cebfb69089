// Rings of vertices along the resting skeleton; shape directions are exact differences of two builds.
#include "tests/support/capsule_body.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

namespace booth::tests {
namespace {

using Eigen::Vector3d;
using fit::kBones;
using Coefficients = Eigen::Matrix<double, kCapsuleShapes, 1>;

constexpr int kSides = 10;
constexpr double kDegree = std::numbers::pi / 180;

struct Skin {
  int bone, other;
  float other_weight;
};

struct Ring {
  Vector3d centre;
  double ru, rw;  // radii along the tube's two transverse axes
  Skin skin;
  int joint = -1;  // the joint that this ring's mean is
};

struct Tip {
  Vector3d point;
  Skin skin;
  int joint = -1;
};

struct Mesh {
  std::vector<Vector3d> vertices;
  std::vector<Eigen::Vector3i> faces;
  std::vector<Skin> skin;
  std::vector<int> mirror;
  std::array<std::vector<int>, kBones> joint_support;
};

int bone(std::string_view name) { return fit::bone_index(name); }
int joint(std::string_view name) { return fit::joint_index(name); }
Skin rigid(int b) { return {b, b, 0}; }
Skin shared(int b, int other, float weight) { return {b, other, weight}; }

/// One closed tube; u x w must point from `first` to `last`. `middle`: it lies in the mirror plane with w across it and is its own mirror image.
void add_tube(Mesh& mesh, const std::vector<Ring>& rings, const Tip& first, const Tip& last, const Vector3d& u, const Vector3d& w, bool middle) {
  const int base = static_cast<int>(mesh.vertices.size());
  const auto put = [&](const Vector3d& p, const Skin& skin, int joint_here) {
    if (joint_here >= 0) mesh.joint_support[joint_here].push_back(static_cast<int>(mesh.vertices.size()));
    mesh.vertices.push_back(p);
    mesh.skin.push_back(skin);
  };
  for (const Ring& ring : rings)
    for (int k = 0; k < kSides; ++k) {
      const double angle = 2 * std::numbers::pi * k / kSides;
      put(ring.centre + ring.ru * std::cos(angle) * u + ring.rw * std::sin(angle) * w, ring.skin, ring.joint);
    }
  const int start = static_cast<int>(mesh.vertices.size());
  put(first.point, first.skin, first.joint);
  put(last.point, last.skin, last.joint);

  const int count = static_cast<int>(rings.size());
  const auto at = [&](int r, int k) { return base + r * kSides + (k + kSides) % kSides; };
  for (int k = 0; k < kSides; ++k) {
    mesh.faces.emplace_back(start, at(0, k + 1), at(0, k));
    mesh.faces.emplace_back(start + 1, at(count - 1, k), at(count - 1, k + 1));
    for (int r = 0; r + 1 < count; ++r) {
      mesh.faces.emplace_back(at(r, k), at(r, k + 1), at(r + 1, k + 1));
      mesh.faces.emplace_back(at(r, k), at(r + 1, k + 1), at(r + 1, k));
    }
  }
  if (middle) {
    for (int r = 0; r < count; ++r)
      for (int k = 0; k < kSides; ++k) mesh.mirror.push_back(at(r, -k));
    mesh.mirror.push_back(start);
    mesh.mirror.push_back(start + 1);
  }
}

/// The right half from the left one.
void add_mirror_image(Mesh& mesh, int first_vertex, int first_face) {
  const int last_vertex = static_cast<int>(mesh.vertices.size()), last_face = static_cast<int>(mesh.faces.size());
  const int shift = last_vertex - first_vertex;
  for (int v = first_vertex; v < last_vertex; ++v) mesh.mirror.push_back(v + shift);
  for (int v = first_vertex; v < last_vertex; ++v) {
    const Vector3d p = mesh.vertices[v];
    mesh.vertices.emplace_back(-p.x(), p.y(), p.z());
    const Skin s = mesh.skin[v];
    mesh.skin.push_back({fit::mirror_bone(s.bone), fit::mirror_bone(s.other), s.other_weight});
    mesh.mirror.push_back(v);
  }
  for (int f = first_face; f < last_face; ++f) {
    const Eigen::Vector3i t = mesh.faces[f];
    mesh.faces.emplace_back(t[0] + shift, t[2] + shift, t[1] + shift);
  }
  for (int j = 0; j < kBones; ++j)
    if (fit::mirror_bone(j) > j)
      for (int v : mesh.joint_support[j]) mesh.joint_support[fit::mirror_bone(j)].push_back(v + shift);
}

fit::PoseVector a_pose() {
  fit::PoseVector q = fit::PoseVector::Zero();
  q[fit::dof_index("lhumerus_rz")] = 42 * kDegree;
  q[fit::dof_index("rhumerus_rz")] = -42 * kDegree;
  q[fit::dof_index("lfemur_rz")] = -11 * kDegree;
  q[fit::dof_index("rfemur_rz")] = 11 * kDegree;
  return q;
}

fit::Points3 resting_joints(const Coefficients& p) {
  fit::Points3 v = fit::average_bone_vectors();
  v *= 1 + 0.04 * p[0];
  for (const char* name : {"lfemur", "ltibia", "rfemur", "rtibia"}) v.col(bone(name)) *= 1 + 0.03 * p[2];
  for (const char* name : {"lhumerus", "lradius", "rhumerus", "rradius"}) v.col(bone(name)) *= 1 + 0.03 * p[3];
  v.col(bone("upperback")) *= 1 + 0.03 * p[4];
  for (const char* name : {"lclavicle", "rclavicle"}) v.col(bone(name)).x() *= 1 + 0.05 * p[5];
  for (const char* name : {"lhipjoint", "rhipjoint"}) v.col(bone(name)).x() *= 1 + 0.05 * p[6];
  for (const char* name : {"head", "lfoot", "ltoes", "rfoot", "rtoes"}) v.col(bone(name)) *= 1 + 0.03 * p[9];
  fit::Kinematics kin;
  fit::forward_kinematics(a_pose(), v, kin);
  return kin.joint;
}

void add_limb(Mesh& mesh, const std::vector<Ring>& rings, const Tip& first, const Tip& last, const Vector3d& direction) {
  const Vector3d d = direction.normalized();
  const Vector3d u = (Vector3d::UnitZ() - d.z() * d).normalized();
  add_tube(mesh, rings, first, last, u, d.cross(u), false);
}

Mesh build(const Coefficients& p) {
  Mesh mesh;
  const fit::Points3 joints = resting_joints(p);
  const auto at = [&](std::string_view name) -> Vector3d { return joints.col(joint(name)); };
  const auto mix = [](const Vector3d& a, const Vector3d& b, double t) -> Vector3d { return a + t * (b - a); };
  const double size = 1 + 0.04 * p[0], girth = size * (1 + 0.08 * p[1]), limb = girth * (1 + 0.08 * p[8]), head_size = size * (1 + 0.03 * p[9]);

  // Trunk: z (depth) is u and x (width) is w, so that u x w points up.
  const int root = bone("root"), back = bone("upperback"), neck = bone("neck"), head = bone("head");
  const Vector3d pelvis = at("root"), pivot = at("spine_pivot"), chest = at("chest_top");
  const Vector3d hips = 0.5 * (at("lhip") + at("rhip"));
  const double hip_width = std::abs(at("lhip").x()), shoulder_width = std::abs(at("lshoulder").x());
  const double belly = girth * (1 + 0.12 * p[7]), waist = girth * (1 + 0.05 * p[7]);
  const std::vector<Ring> trunk{
      {mix(pelvis, hips, 1.45), 0.085 * girth, 0.35 * hip_width + 0.075 * girth, rigid(root)},
      {mix(pelvis, hips, 0.9), 0.110 * girth, 0.55 * hip_width + 0.115 * girth, rigid(root)},
      {pelvis, 0.105 * belly, 0.3 * hip_width + 0.125 * girth, rigid(root), joint("root")},
      {pivot, 0.100 * belly, 0.145 * waist, shared(root, back, 0.5f), joint("spine_pivot")},
      {mix(pivot, chest, 0.30), 0.102 * belly, 0.140 * waist, shared(back, root, 0.15f)},
      {mix(pivot, chest, 0.55), 0.108 * girth, 0.4 * shoulder_width + 0.080 * girth, rigid(back)},
      {mix(pivot, chest, 0.80), 0.110 * girth, 0.5 * shoulder_width + 0.075 * girth, rigid(back)},
      {chest, 0.095 * girth, 0.6 * shoulder_width + 0.055 * girth, rigid(back), joint("chest_top")},
      {mix(pivot, chest, 1.22), 0.065 * girth, 0.5 * shoulder_width + 0.030 * girth, rigid(back)},
  };
  add_tube(mesh, trunk, {mix(pelvis, hips, 1.75), rigid(root)}, {mix(pivot, chest, 1.32), rigid(back)}, Vector3d::UnitZ(), Vector3d::UnitX(), true);

  const Vector3d neck_pivot = at("neck_pivot"), head_base = at("head_base"), head_top = at("head_top");
  const std::vector<Ring> skull{
      {neck_pivot, 0.058 * girth, 0.058 * girth, shared(back, neck, 0.5f), joint("neck_pivot")},
      {mix(neck_pivot, head_base, 0.35), 0.055 * girth, 0.055 * girth, rigid(neck)},
      {mix(neck_pivot, head_base, 0.65), 0.080 * head_size, 0.064 * head_size, shared(head, neck, 0.4f)},
      {head_base, 0.096 * head_size, 0.076 * head_size, rigid(head), joint("head_base")},
      {mix(head_base, head_top, 0.45), 0.098 * head_size, 0.077 * head_size, rigid(head)},
      {mix(head_base, head_top, 0.85), 0.062 * head_size, 0.052 * head_size, rigid(head)},
  };
  add_tube(mesh, skull, {mix(neck_pivot, head_base, -0.5), rigid(back)}, {head_top, rigid(head), joint("head_top")}, Vector3d::UnitZ(), Vector3d::UnitX(),
           true);

  // The left limbs; the right ones are their mirror image.
  const int first_vertex = static_cast<int>(mesh.vertices.size()), first_face = static_cast<int>(mesh.faces.size());
  const int thigh = bone("lfemur"), shank = bone("ltibia"), foot = bone("lfoot"), toes = bone("ltoes");
  const Vector3d hip = at("lhip"), knee = at("lknee"), ankle = at("lankle"), foot_end = at("lfoot_end"), toe_end = at("ltoe_end");
  const std::vector<Ring> leg{
      {hip, 0.088 * limb, 0.082 * limb, shared(thigh, root, 0.5f), joint("lhip")},
      {mix(hip, knee, 0.20), 0.087 * limb, 0.083 * limb, shared(thigh, root, 0.15f)},
      {mix(hip, knee, 0.45), 0.078 * limb, 0.074 * limb, rigid(thigh)},
      {mix(hip, knee, 0.75), 0.064 * limb, 0.060 * limb, rigid(thigh)},
      {knee, 0.057 * limb, 0.054 * limb, shared(shank, thigh, 0.5f), joint("lknee")},
      {mix(knee, ankle, 0.15), 0.058 * limb, 0.054 * limb, rigid(shank)},
      {mix(knee, ankle, 0.35), 0.060 * limb, 0.056 * limb, rigid(shank)},
      {mix(knee, ankle, 0.65), 0.047 * limb, 0.044 * limb, rigid(shank)},
      {ankle, 0.038 * limb, 0.034 * limb, shared(shank, foot, 0.5f), joint("lankle")},
  };
  add_limb(mesh, leg, {mix(hip, knee, -0.08), rigid(root)}, {mix(knee, ankle, 1.06), rigid(foot)}, ankle - hip);
  const double foot_size = size * (1 + 0.03 * p[9]);
  const std::vector<Ring> sole{
      {ankle + foot_size * Vector3d(0, -0.030, -0.035), 0.032 * foot_size, 0.035 * foot_size, rigid(foot)},
      {mix(ankle, foot_end, 0.35) + foot_size * Vector3d(0, -0.020, 0), 0.038 * foot_size, 0.042 * foot_size, rigid(foot)},
      {mix(ankle, foot_end, 0.75) + foot_size * Vector3d(0, -0.005, 0), 0.045 * foot_size, 0.032 * foot_size, rigid(foot)},
      {foot_end, 0.045 * foot_size, 0.024 * foot_size, shared(foot, toes, 0.5f), joint("lfoot_end")},
      {mix(foot_end, toe_end, 0.7), 0.032 * foot_size, 0.016 * foot_size, rigid(toes)},
  };
  add_tube(mesh, sole, {ankle + foot_size * Vector3d(0, -0.035, -0.060), rigid(foot)}, {toe_end, rigid(toes), joint("ltoe_end")}, Vector3d::UnitX(),
           Vector3d::UnitY(), false);

  const int clavicle = bone("lclavicle"), upper = bone("lhumerus"), fore = bone("lradius"), hand = bone("lhand");
  const Vector3d shoulder = at("lshoulder"), elbow = at("lelbow"), wrist = at("lwrist"), hand_end = at("lhand_end");
  const std::vector<Ring> arm{
      {shoulder, 0.054 * limb, 0.052 * limb, shared(upper, clavicle, 0.5f), joint("lshoulder")},
      {mix(shoulder, elbow, 0.25), 0.052 * limb, 0.050 * limb, shared(upper, clavicle, 0.1f)},
      {mix(shoulder, elbow, 0.50), 0.047 * limb, 0.046 * limb, rigid(upper)},
      {mix(shoulder, elbow, 0.78), 0.042 * limb, 0.041 * limb, rigid(upper)},
      {elbow, 0.040 * limb, 0.040 * limb, shared(fore, upper, 0.5f), joint("lelbow")},
      {mix(elbow, wrist, 0.22), 0.041 * limb, 0.041 * limb, rigid(fore)},
      {mix(elbow, wrist, 0.50), 0.036 * limb, 0.036 * limb, rigid(fore)},
      {mix(elbow, wrist, 0.78), 0.030 * limb, 0.029 * limb, rigid(fore)},
      {wrist, 0.029 * limb, 0.025 * limb, shared(fore, hand, 0.5f), joint("lwrist")},
      {hand_end, 0.042 * limb, 0.020 * limb, rigid(hand), joint("lhand_end")},
      {mix(wrist, hand_end, 3.0), 0.038 * limb, 0.018 * limb, rigid(hand)},
  };
  add_limb(mesh, arm, {mix(shoulder, elbow, -0.15), rigid(clavicle)}, {mix(wrist, hand_end, 4.4), rigid(hand)}, wrist - shoulder);

  add_mirror_image(mesh, first_vertex, first_face);
  return mesh;
}

}  // namespace

fit::BodyModelData capsule_body_data(fit::Sex sex) {
  Coefficients base = Coefficients::Zero();
  if (sex == fit::Sex::women) base << -1.8, -0.5, 0, 0, 0, -1, 2, 0, -0.5, 0;
  const Mesh mesh = build(base);
  const int count = static_cast<int>(mesh.vertices.size());

  fit::BodyModelData data;
  data.sex = sex;
  data.version = std::string("capsule-") + fit::to_string(sex);
  data.mean.resize(3, count);
  for (int v = 0; v < count; ++v) data.mean.col(v) = mesh.vertices[v].cast<float>();
  data.directions.resize(3 * count, kCapsuleShapes);
  data.explained.resize(kCapsuleShapes);
  Eigen::VectorXd variance(kCapsuleShapes);
  for (int k = 0; k < kCapsuleShapes; ++k) {
    Coefficients moved = base;
    moved[k] += 1;
    const Mesh other = build(moved);
    for (int v = 0; v < count; ++v) data.directions.block<3, 1>(3 * v, k) = (other.vertices[v] - mesh.vertices[v]).cast<float>();
    variance[k] = data.directions.col(k).squaredNorm();
  }
  double sum = 0;
  for (int k = 0; k < kCapsuleShapes; ++k) data.explained[k] = (sum += variance[k]) / variance.sum();

  data.faces.resize(3, static_cast<int>(mesh.faces.size()));
  for (int f = 0; f < data.faces.cols(); ++f) data.faces.col(f) = mesh.faces[f];
  data.skin_bone.setZero(fit::kSkinBones, count);
  data.skin_weight.setZero(fit::kSkinBones, count);
  for (int v = 0; v < count; ++v) {
    const Skin& s = mesh.skin[v];
    data.skin_bone(0, v) = static_cast<std::uint8_t>(s.bone);
    data.skin_bone(1, v) = static_cast<std::uint8_t>(s.other);
    data.skin_weight(0, v) = 1 - s.other_weight;
    data.skin_weight(1, v) = s.other_weight;
  }
  data.joint_regressor.setZero(fit::kJoints, count);
  for (int j = 0; j < fit::kJoints; ++j)
    for (int v : mesh.joint_support[j]) data.joint_regressor(j, v) = 1.0 / static_cast<double>(mesh.joint_support[j].size());
  data.rest_pose = a_pose();
  data.mirror_vertex = Eigen::Map<const Eigen::VectorXi>(mesh.mirror.data(), count);
  return data;
}

std::shared_ptr<const fit::BodyModel> capsule_body(fit::Sex sex) { return std::make_shared<const fit::BodyModel>(capsule_body_data(sex)); }

}  // namespace booth::tests

// The bone table and forward kinematics; the numbers are the CMU average skeleton's (NOTICE).
#include "fit/body/skeleton.hpp"

#include <algorithm>
#include <cmath>

#include "fit/body/exact_math.hpp"

namespace booth::fit {
namespace {

constexpr std::array<int, 3> kFixed{-1, -1, -1};

constexpr std::array<Bone, kBones> kBoneTable{{
    {"root", "root", -1, {0, 0, 0}, {3, 4, 5}},
    {"lhipjoint", "lhip", 0, {0, 0, 0}, kFixed},
    {"lfemur", "lknee", 1, {0, 0, 20}, {24, 25, 26}},
    {"ltibia", "lankle", 2, {0, 0, 20}, {27, -1, -1}},
    {"lfoot", "lfoot_end", 3, {-90, 0, 20}, {28, -1, 29}},
    {"ltoes", "ltoe_end", 4, {-90, 0, 20}, kFixed},
    {"rhipjoint", "rhip", 0, {0, 0, 0}, kFixed},
    {"rfemur", "rknee", 6, {0, 0, -20}, {30, 31, 32}},
    {"rtibia", "rankle", 7, {0, 0, -20}, {33, -1, -1}},
    {"rfoot", "rfoot_end", 8, {-90, 0, -20}, {34, -1, 35}},
    {"rtoes", "rtoe_end", 9, {-90, 0, -20}, kFixed},
    {"spine_fixed", "spine_pivot", 0, {0, 0, 0}, kFixed},
    {"upperback", "chest_top", 11, {0, 0, 0}, {6, 7, 8}},
    {"lclavicle", "lshoulder", 12, {0, 0, 0}, {-1, 9, 10}},
    {"lhumerus", "lelbow", 13, {180, -30, -90}, {11, 12, 13}},
    {"lradius", "lwrist", 14, {180, -30, -90}, {14, -1, -1}},
    {"lhand", "lhand_end", 15, {0, 0, 0}, kFixed},
    {"rclavicle", "rshoulder", 12, {0, 0, 0}, {-1, 15, 16}},
    {"rhumerus", "relbow", 17, {180, 30, 90}, {17, 18, 19}},
    {"rradius", "rwrist", 18, {180, 30, 90}, {20, -1, -1}},
    {"rhand", "rhand_end", 19, {0, 0, 0}, kFixed},
    {"neck_fixed", "neck_pivot", 12, {0, 0, 0}, kFixed},
    {"neck", "head_base", 21, {0, 0, 0}, {21, -1, 22}},
    {"head", "head_top", 22, {0, 0, 0}, {-1, 23, -1}},
}};

constexpr std::array<std::array<double, 3>, kBones> kAverageVectors{{
    {0.000000, 0.000000, 0.000000},   {0.089178, -0.099169, 0.041838},  {0.137337, -0.377330, 0.000000},   {0.146438, -0.402335, 0.000000},
    {0.009731, -0.026711, 0.113782},  {-0.000002, -0.000001, 0.058993}, {-0.089178, -0.099169, 0.041838},  {-0.137337, -0.377330, 0.000000},
    {-0.146438, -0.402335, 0.000000}, {-0.009731, -0.026711, 0.113782}, {0.000002, -0.000001, 0.058993},   {0.000000, 0.050827, -0.003931},
    {0.000000, 0.298035, -0.002466},  {0.180284, 0.064964, -0.008808},  {0.292819, -0.000004, -0.000007},  {0.280160, 0.000000, 0.000000},
    {0.037440, 0.000000, 0.000000},   {-0.180284, 0.064964, -0.008808}, {-0.292819, -0.000004, -0.000007}, {-0.280160, 0.000000, 0.000000},
    {-0.037440, 0.000000, 0.000000},  {0.000000, 0.047778, 0.004143},   {0.000000, 0.142478, -0.009522},   {0.000000, 0.098235, -0.005735},
}};

constexpr std::array<std::string_view, kDofs> kDofNames{
    "root_tx",      "root_ty",      "root_tz",     "root_rx",     "root_ry",     "root_rz",    "upperback_rx", "upperback_ry", "upperback_rz",
    "lclavicle_ry", "lclavicle_rz", "lhumerus_rx", "lhumerus_ry", "lhumerus_rz", "lradius_rx", "rclavicle_ry", "rclavicle_rz", "rhumerus_rx",
    "rhumerus_ry",  "rhumerus_rz",  "rradius_rx",  "neck_rx",     "neck_rz",     "head_ry",    "lfemur_rx",    "lfemur_ry",    "lfemur_rz",
    "ltibia_rx",    "lfoot_rx",     "lfoot_rz",    "rfemur_rx",   "rfemur_ry",   "rfemur_rz",  "rtibia_rx",    "rfoot_rx",     "rfoot_rz"};

// Entries whose sign changes in a mirror: sideways translation, and every rotation about the up or forward axis.
constexpr std::array<int, 21> kMirrorNegated{0, 4, 5, 7, 8, 22, 23, 9, 10, 12, 13, 15, 16, 18, 19, 25, 26, 29, 31, 32, 35};

Eigen::Matrix3d about_x(double angle) {
  const auto [s, c] = exact_sincos(angle);
  return (Eigen::Matrix3d() << 1, 0, 0, 0, c, -s, 0, s, c).finished();
}
Eigen::Matrix3d about_y(double angle) {
  const auto [s, c] = exact_sincos(angle);
  return (Eigen::Matrix3d() << c, 0, s, 0, 1, 0, -s, 0, c).finished();
}
Eigen::Matrix3d about_z(double angle) {
  const auto [s, c] = exact_sincos(angle);
  return (Eigen::Matrix3d() << c, -s, 0, s, c, 0, 0, 0, 1).finished();
}

/// C of every bone, computed once.
const std::array<Eigen::Matrix3d, kBones>& axis_frames() {
  static const auto frames = [] {
    constexpr double degree = 3.14159265358979323846 / 180.0;
    std::array<Eigen::Matrix3d, kBones> f;
    for (int b = 0; b < kBones; ++b) {
      const auto& a = kBoneTable[b].axis_deg;
      f[b] = about_z(a[2] * degree) * about_y(a[1] * degree) * about_x(a[0] * degree);
    }
    return f;
  }();
  return frames;
}

}  // namespace

std::span<const Bone, kBones> bones() { return kBoneTable; }

int bone_index(std::string_view name) {
  const auto it = std::find_if(kBoneTable.begin(), kBoneTable.end(), [&](const Bone& b) { return b.name == name; });
  return it == kBoneTable.end() ? -1 : static_cast<int>(it - kBoneTable.begin());
}

int joint_index(std::string_view end_joint) {
  const auto it = std::find_if(kBoneTable.begin(), kBoneTable.end(), [&](const Bone& b) { return b.end_joint == end_joint; });
  return it == kBoneTable.end() ? -1 : static_cast<int>(it - kBoneTable.begin());
}

std::string_view dof_name(int dof) { return kDofNames[static_cast<std::size_t>(dof)]; }

int dof_index(std::string_view name) {
  const auto it = std::find(kDofNames.begin(), kDofNames.end(), name);
  return it == kDofNames.end() ? -1 : static_cast<int>(it - kDofNames.begin());
}

std::span<const int, 15> main_joints() {
  // root, chest_top, head_base; shoulders, elbows, wrists, hips, knees, ankles
  static constexpr std::array<int, 15> joints{0, 12, 22, 13, 17, 14, 18, 15, 19, 1, 6, 2, 7, 3, 8};
  return joints;
}

const Points3& average_bone_vectors() {
  static const Points3 vectors = [] {
    Points3 v;
    for (int b = 0; b < kBones; ++b) v.col(b) = Eigen::Map<const Eigen::Vector3d>(kAverageVectors[b].data());
    return v;
  }();
  return vectors;
}

void forward_kinematics(const PoseVector& q, const Points3& bone_vectors, Kinematics& out) {
  const auto& frames = axis_frames();
  out.joint.col(0) = q.head<3>();
  const Eigen::Matrix3d heading = about_y(q[4]);
  const Eigen::Matrix3d heading_pitch = heading * about_x(q[3]);
  out.rotation[0] = heading_pitch * about_z(q[5]);
  out.axis.leftCols<3>().setIdentity();
  out.axis.col(3) = heading.col(0);
  out.axis.col(4) = Eigen::Vector3d::UnitY();
  out.axis.col(5) = heading_pitch.col(2);
  out.pivot.leftCols<3>().setZero();
  out.pivot.middleCols<3>(3).colwise() = out.joint.col(0);

  for (int b = 1; b < kBones; ++b) {
    const Bone& bone = kBoneTable[b];
    const Eigen::Matrix3d& parent = out.rotation[bone.parent];
    const Eigen::Vector3d start = out.joint.col(bone.parent);
    if (bone.dof == kFixed) {
      out.rotation[b] = parent;
    } else {
      // The three turns act one inside the other: Z outermost, X innermost.
      Eigen::Matrix3d local = parent * frames[b];
      const auto turn = [&](int dof, int column, const Eigen::Matrix3d& r) {
        out.axis.col(dof) = local.col(column);
        out.pivot.col(dof) = start;
        local = (local * r).eval();
      };
      if (bone.dof[2] >= 0) turn(bone.dof[2], 2, about_z(q[bone.dof[2]]));
      if (bone.dof[1] >= 0) turn(bone.dof[1], 1, about_y(q[bone.dof[1]]));
      if (bone.dof[0] >= 0) turn(bone.dof[0], 0, about_x(q[bone.dof[0]]));
      out.rotation[b] = local * frames[b].transpose();
    }
    out.joint.col(b) = start + out.rotation[b] * bone_vectors.col(b);
  }
}

std::uint64_t dof_mask(int bone) {
  static const auto masks = [] {
    std::array<std::uint64_t, kBones> m{};
    for (int b = 0; b < kBones; ++b) {
      m[b] = b == 0 ? 0b111u : m[kBoneTable[b].parent];
      for (int d : kBoneTable[b].dof)
        if (d >= 0) m[b] |= std::uint64_t{1} << d;
    }
    return m;
  }();
  return masks[bone];
}

void turn_about_length(int bone, double angle, PoseVector& q) {
  const auto& [rx, ry, rz] = kBoneTable[static_cast<std::size_t>(bone)].dof;
  const Eigen::Matrix3d turned = about_z(q[rz]) * about_y(q[ry]) * about_x(q[rx]) * about_y(angle);
  const double across = std::sqrt(std::max(1 - turned(2, 0) * turned(2, 0), 1e-12));
  q[rx] = exact_angle(turned(2, 1) / across, turned(2, 2) / across);
  q[ry] = exact_angle(-turned(2, 0), across);
  q[rz] = exact_angle(turned(1, 0) / across, turned(0, 0) / across);
}

PoseVector mirror(const PoseVector& q) {
  PoseVector m = q;
  m.segment<6>(9) = q.segment<6>(15);
  m.segment<6>(15) = q.segment<6>(9);
  m.segment<6>(24) = q.segment<6>(30);
  m.segment<6>(30) = q.segment<6>(24);
  for (int i : kMirrorNegated) m[i] = -m[i];
  return m;
}

int mirror_bone(int bone) {
  if (bone >= 1 && bone <= 5) return bone + 5;
  if (bone >= 6 && bone <= 10) return bone - 5;
  if (bone >= 13 && bone <= 16) return bone + 4;
  if (bone >= 17 && bone <= 20) return bone - 4;
  return bone;
}

}  // namespace booth::fit

// The kinematic tree that q drives: which bone turns about which axes, and where its joints are for any pose.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <string_view>

namespace booth::fit {

inline constexpr int kDofs = 36;      ///< length of q
inline constexpr int kRootDofs = 6;   ///< q[0..5]: translation (m) and heading, pitch, roll (rad)
inline constexpr int kPoseDofs = 30;  ///< q[6..35], the joint angles that have a prior
inline constexpr int kBones = 24;
inline constexpr int kJoints = kBones;  ///< joint b is the END of bone b; joint 0 is the root itself

using PoseVector = Eigen::Matrix<double, kDofs, 1>;
using Points3 = Eigen::Matrix<double, 3, kBones>;

/// One bone of the CMU skeleton with the degrees of freedom that the paper keeps.
struct Bone {
  std::string_view name;           ///< CMU's ASF name
  std::string_view end_joint;      ///< name of the point at the bone's end
  int parent;                      ///< index of the parent bone, -1 for the root; parents stand before children
  std::array<double, 3> axis_deg;  ///< ASF axis: C = Z(z) Y(y) X(x)
  std::array<int, 3> dof;          ///< q index of rx, ry, rz; -1 where the bone does not turn
};

/// In the row order of the CMU average skeleton (docs/reference/skeleton.md).
std::span<const Bone, kBones> bones();

/// A set of bones: bit b stands for bone b of bones().
using BoneSet = std::uint32_t;

/// Index of a bone or of a joint by name; -1 when there is none.
int bone_index(std::string_view name);
int joint_index(std::string_view end_joint);

/// Short name of a degree of freedom, e.g. "lfemur_rx".
std::string_view dof_name(int dof);
int dof_index(std::string_view name);

/// The 15 points that error tables call the main joints.
std::span<const int, 15> main_joints();

/// The CMU average skeleton: bone vectors in the neutral pose, metres, CMU frame (y up, z forward, x left).
const Points3& average_bone_vectors();

/// World rotation of every bone and world position of every joint (CMU frame).
struct Kinematics {
  std::array<Eigen::Matrix3d, kBones> rotation;  ///< G_b, the identity for all bones at q = 0
  Points3 joint;                                 ///< joint.col(b) = end of bone b; its start is joint.col(parent)
  /// For each q index: the world axis about which it turns (or along which it moves, for q[0..2]) and the point that stays put.
  Eigen::Matrix<double, 3, kDofs> axis;
  Eigen::Matrix<double, 3, kDofs> pivot;
};

/// Forward kinematics: root G = Y(q4) X(q3) Z(q5); bone b: G_b = G_parent C R C^T with R = Z(rz) Y(ry) X(rx), P_b = P_parent + G_b v_b.
/// Deterministic on every machine (no libm). Thread-safe.
void forward_kinematics(const PoseVector& q, const Points3& bone_vectors, Kinematics& out);

/// Point where a bone starts (the pivot of its rotation).
inline int start_joint(int bone) { return bone == 0 ? 0 : bones()[bone].parent; }

/// Which q entries move bone b: bit k of the mask is set when q[k] turns or moves b.
std::uint64_t dof_mask(int bone);

/// Turns a bone that has three angles about the y axis of its own frame, the length of a thigh or an upper arm: its end stays where it is, what hangs on it
/// goes round. Radians; the angles come out in (-pi, pi], the middle one within a quarter turn. Deterministic on every machine.
void turn_about_length(int bone, double angle, PoseVector& q);

/// The same pose seen in a mirror (left and right exchanged). An involution.
PoseVector mirror(const PoseVector& q);

/// Index of the left/right counterpart of a bone or joint; itself when it lies in the middle.
int mirror_bone(int bone);

/// Booth frame (x forward, y left, z up) from the CMU frame (z forward, x left, y up), and back.
inline Eigen::Vector3d booth_from_cmu(const Eigen::Vector3d& p) { return {p.z(), p.x(), p.y()}; }
inline Eigen::Vector3d cmu_from_booth(const Eigen::Vector3d& p) { return {p.y(), p.z(), p.x()}; }

}  // namespace booth::fit

// HIERARCHY from the bone table, MOTION from forward kinematics, so that any reader's joints are ours.
#include "daemon/io/bvh_file.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <iterator>
#include <stdexcept>

#include "daemon/io/atomic_file.hpp"

namespace booth::daemon {
namespace {

constexpr double kDegrees = 180.0 / 3.14159265358979323846;

/// z, y, x in degrees with r = Z(z) Y(y) X(x).
Eigen::Vector3d zyx_angles(const Eigen::Matrix3d& r) {
  const double cos_y = std::hypot(r(0, 0), r(1, 0));
  const double y = std::atan2(-r(2, 0), cos_y);
  // At y = +-90 degrees z and x turn about the same axis; all of it is given to z.
  if (cos_y < 1e-9) return kDegrees * Eigen::Vector3d(std::atan2(-r(0, 1), r(1, 1)), y, 0);
  return kDegrees * Eigen::Vector3d(std::atan2(r(1, 0), r(0, 0)), y, std::atan2(r(2, 1), r(2, 2)));
}

void append_node(std::string& out, const fit::Points3& vectors, int bone, int depth) {
  const auto bones = fit::bones();
  const std::string indent(static_cast<std::size_t>(2 * depth), ' ');
  auto to = std::back_inserter(out);
  const auto offset = [&](const std::string& before, const Eigen::Vector3d& v) {
    fmt::format_to(to, "{}OFFSET {:.6f} {:.6f} {:.6f}\n", before, v.x(), v.y(), v.z());
  };
  const bool root = bone == 0;
  fmt::format_to(to, "{}{} {}\n{}{{\n", indent, root ? "ROOT" : "JOINT", bones[static_cast<std::size_t>(bone)].name, indent);
  offset(indent + "  ", root ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : Eigen::Vector3d(vectors.col(bones[static_cast<std::size_t>(bone)].parent)));
  fmt::format_to(to, "{}  CHANNELS {} {}Zrotation Yrotation Xrotation\n", indent, root ? 6 : 3, root ? "Xposition Yposition Zposition " : "");
  bool leaf = true;
  for (int child = bone + 1; child < fit::kBones; ++child) {
    if (bones[static_cast<std::size_t>(child)].parent != bone) continue;
    leaf = false;
    append_node(out, vectors, child, depth + 1);
  }
  if (leaf) {
    fmt::format_to(to, "{0}  End Site\n{0}  {{\n", indent);
    offset(indent + "    ", vectors.col(bone));
    fmt::format_to(to, "{}  }}\n", indent);
  }
  fmt::format_to(to, "{}}}\n", indent);
}

/// The same turn written with the angles nearest to those of the frame before, so that a program that interpolates between frames never spins round.
Eigen::Vector3d nearest_to(const Eigen::Vector3d& before, Eigen::Vector3d angles) {
  const auto unwound = [&](Eigen::Vector3d a) {
    for (int i = 0; i < 3; ++i) a[i] += 360 * std::round((before[i] - a[i]) / 360);
    return a;
  };
  // Z(z) Y(y) X(x) = Z(z + 180) Y(180 - y) X(x + 180).
  const Eigen::Vector3d one = unwound(angles), other = unwound({angles[0] + 180, 180 - angles[1], angles[2] + 180});
  return (one - before).squaredNorm() <= (other - before).squaredNorm() ? one : other;
}

}  // namespace

std::string bvh_text(const fit::Points3& bone_vectors, std::span<const fit::PoseVector> poses, double frame_seconds) {
  if (!(frame_seconds > 0)) throw std::invalid_argument("bvh: the time between frames must be positive");
  std::string out = "HIERARCHY\n";
  append_node(out, bone_vectors, 0, 0);
  fmt::format_to(std::back_inserter(out), "MOTION\nFrames: {}\nFrame Time: {:.8f}\n", poses.size(), frame_seconds);
  fit::Kinematics kinematics;
  std::array<Eigen::Vector3d, fit::kBones> angles;
  angles.fill(Eigen::Vector3d::Zero());
  // Channels follow in the order of the hierarchy: depth first, which is the order of the bone table.
  const auto bones = fit::bones();
  for (const fit::PoseVector& q : poses) {
    fit::forward_kinematics(q, bone_vectors, kinematics);
    auto to = std::back_inserter(out);
    fmt::format_to(to, "{:.6f} {:.6f} {:.6f}", q[0], q[1], q[2]);
    for (std::size_t b = 0; b < fit::kBones; ++b) {
      Eigen::Matrix3d local = kinematics.rotation[b];
      if (b > 0) local = kinematics.rotation[static_cast<std::size_t>(bones[b].parent)].transpose() * kinematics.rotation[b];
      angles[b] = nearest_to(angles[b], zyx_angles(local));
      fmt::format_to(to, " {:.6f} {:.6f} {:.6f}", angles[b][0], angles[b][1], angles[b][2]);
    }
    out += '\n';
  }
  return out;
}

void write_bvh(const FileTarget& target, const fit::Points3& bone_vectors, std::span<const fit::PoseVector> poses, double frame_seconds) {
  write_file_atomically(target, bvh_text(bone_vectors, poses, frame_seconds));
}

}  // namespace booth::daemon

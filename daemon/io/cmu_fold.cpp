// Start from the products of the folded rotations, then least squares on joint positions.
#include "daemon/io/cmu_fold.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace booth::daemon {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

struct Entry {
  std::string_view name;
  CmuBone parent;                // count: the root
  std::array<double, 3> vector;  // of the average skeleton, metres (NOTICE)
  std::array<double, 3> axis;    // degrees
};
using enum CmuBone;

constexpr std::array<Entry, kCmuBones> kTable{{
    {"lfemur", count, {0.137337, -0.377330, 0}, {0, 0, 20}},
    {"ltibia", lfemur, {0.146438, -0.402335, 0}, {0, 0, 20}},
    {"lfoot", ltibia, {0.009731, -0.026711, 0.113782}, {-90, 0, 20}},
    {"rfemur", count, {-0.137337, -0.377330, 0}, {0, 0, -20}},
    {"rtibia", rfemur, {-0.146438, -0.402335, 0}, {0, 0, -20}},
    {"rfoot", rtibia, {-0.009731, -0.026711, 0.113782}, {-90, 0, -20}},
    {"lowerback", count, {0, 0.115516, -0.008933}, {0, 0, 0}},
    {"upperback", lowerback, {0, 0.115999, -0.000864}, {0, 0, 0}},
    {"thorax", upperback, {0, 0.117347, 0.003400}, {0, 0, 0}},
    {"lowerneck", thorax, {0, 0.095557, 0.008286}, {0, 0, 0}},
    {"upperneck", lowerneck, {0, 0.094699, -0.013665}, {0, 0, 0}},
    {"head", upperneck, {0, 0.098235, -0.005735}, {0, 0, 0}},
    {"lclavicle", thorax, {0.180284, 0.064964, -0.008808}, {0, 0, 0}},
    {"lhumerus", lclavicle, {0.292819, -0.000004, -0.000007}, {180, -30, -90}},
    {"lradius", lhumerus, {0.280160, 0, 0}, {180, -30, -90}},
    {"rclavicle", thorax, {-0.180284, 0.064964, -0.008808}, {0, 0, 0}},
    {"rhumerus", rclavicle, {-0.292819, -0.000004, -0.000007}, {180, 30, 90}},
    {"rradius", rhumerus, {-0.280160, 0, 0}, {180, 30, 90}},
}};

Vector3d vector_of(int b) { return Vector3d(kTable[static_cast<std::size_t>(b)].vector.data()); }

/// rx, ry, rz of R = Z Y X.
Vector3d zyx(const Matrix3d& r) { return {std::atan2(r(2, 1), r(2, 2)), std::asin(std::clamp(-r(2, 0), -1.0, 1.0)), std::atan2(r(1, 0), r(0, 0))}; }

constexpr int kFirst = 6, kCount = 18;  // q[6..23], the upper body
constexpr int kDirections = 2, kPoints = 9 + kDirections;
constexpr double kReach = 0.1, kDirectionWeight = 0.3, kPull = 0.02;  // metres; relative; metres per radian

struct Target {
  int joint;        // of q's skeleton, whose bone carries the point
  Vector3d offset;  // from the joint, in the bone's frame
  double weight;
};

const std::array<Target, kPoints>& targets() {
  static const std::array<Target, kPoints> list = [] {
    std::array<Target, kPoints> t;
    int i = 0;
    for (const char* name : {"chest_top", "lshoulder", "lelbow", "lwrist", "rshoulder", "relbow", "rwrist", "head_base", "head_top"})
      t[static_cast<std::size_t>(i++)] = {fit::joint_index(name), Vector3d::Zero(), 1};
    for (const char* name : {"chest_top", "head_top"})
      t[static_cast<std::size_t>(i++)] = {fit::joint_index(name), kReach * Vector3d::UnitZ(), kDirectionWeight};
    return t;
  }();
  return list;
}

using Points = Eigen::Matrix<double, 3, kPoints>;

/// Where the full skeleton has the target points.
Points full_points(const CmuPose& pose) {
  std::array<Matrix3d, kCmuBones> rotation;
  std::array<Vector3d, kCmuBones> end;
  for (int b = 0; b < kCmuBones; ++b) {
    const auto i = static_cast<std::size_t>(b);
    const CmuBone parent = kTable[i].parent;
    const bool from_root = parent == count;
    rotation[i] = (from_root ? pose.root : rotation[static_cast<std::size_t>(parent)]) * pose.local[i];
    end[i] = (from_root ? pose.position : end[static_cast<std::size_t>(parent)]) + rotation[i] * vector_of(b);
  }
  Points p;
  int column = 0;
  for (const CmuBone b : {thorax, lclavicle, lhumerus, lradius, rclavicle, rhumerus, rradius, upperneck, head})
    p.col(column++) = end[static_cast<std::size_t>(b)];
  for (const CmuBone b : {thorax, head})
    p.col(column++) = end[static_cast<std::size_t>(b)] + rotation[static_cast<std::size_t>(b)] * (kReach * Vector3d::UnitZ());
  return p;
}

using Residual = Eigen::Matrix<double, 3 * kPoints + kCount, 1>;
using Jacobian = Eigen::Matrix<double, 3 * kPoints + kCount, kCount>;

void evaluate(const fit::PoseVector& q, const fit::PoseVector& start, const Points& wanted, Residual& r, Jacobian* jacobian) {
  fit::Kinematics kin;
  fit::forward_kinematics(q, fit::average_bone_vectors(), kin);
  if (jacobian) jacobian->setZero();
  for (int i = 0; i < kPoints; ++i) {
    const Target& t = targets()[static_cast<std::size_t>(i)];
    const Vector3d p = kin.joint.col(t.joint) + kin.rotation[t.joint] * t.offset;
    r.segment<3>(3 * i) = t.weight * (p - wanted.col(i));
    if (!jacobian) continue;
    const std::uint64_t mask = fit::dof_mask(t.joint);
    for (int k = 0; k < kCount; ++k)
      if (mask >> (kFirst + k) & 1u) jacobian->block<3, 1>(3 * i, k) = t.weight * kin.axis.col(kFirst + k).cross(p - kin.pivot.col(kFirst + k));
  }
  r.tail<kCount>() = kPull * (q - start).segment<kCount>(kFirst);
  if (jacobian) jacobian->bottomRows<kCount>().diagonal().setConstant(kPull);
}

void refine(fit::PoseVector& q, const Points& wanted) {
  const fit::PoseVector start = q;
  Residual r, tried;
  Jacobian j;
  double damping = 1e-4;
  evaluate(q, start, wanted, r, &j);
  for (int iteration = 0; iteration < 30; ++iteration) {
    Eigen::Matrix<double, kCount, kCount> a = j.transpose() * j;
    const Eigen::Matrix<double, kCount, 1> gradient = j.transpose() * r;
    a.diagonal() *= 1 + damping;
    a.diagonal().array() += 1e-9;
    fit::PoseVector next = q;
    const Eigen::Matrix<double, kCount, 1> step = a.ldlt().solve(gradient);
    next.segment<kCount>(kFirst) -= step;
    evaluate(next, start, wanted, tried, nullptr);
    if (tried.squaredNorm() < r.squaredNorm()) {
      q = next;
      evaluate(q, start, wanted, r, &j);
      damping = std::max(damping / 10, 1e-9);
      if (step.norm() < 1e-6) break;
    } else if ((damping *= 10) > 1e6) {
      break;
    }
  }
}

}  // namespace

int cmu_bone(std::string_view asf_name) {
  for (int b = 0; b < kCmuBones; ++b)
    if (kTable[static_cast<std::size_t>(b)].name == asf_name) return b;
  return -1;
}

const Matrix3d& cmu_axes(int bone) {
  static const auto all = [] {
    std::array<Matrix3d, kCmuBones> list;
    constexpr double degree = std::numbers::pi / 180;
    for (std::size_t b = 0; b < kCmuBones; ++b) {
      const auto& a = kTable[b].axis;
      list[b] = (Eigen::AngleAxisd(a[2] * degree, Vector3d::UnitZ()) * Eigen::AngleAxisd(a[1] * degree, Vector3d::UnitY()) *
                 Eigen::AngleAxisd(a[0] * degree, Vector3d::UnitX()))
                    .matrix();
    }
    return list;
  }();
  return all[static_cast<std::size_t>(bone)];
}

fit::PoseVector fold(const CmuPose& pose, const fit::PoseVector* previous) {
  fit::PoseVector q = fit::PoseVector::Zero();
  const auto local = [&](CmuBone b) -> const Matrix3d& { return pose.local[static_cast<std::size_t>(b)]; };
  const auto angles = [&](CmuBone b) {
    const Matrix3d& c = cmu_axes(static_cast<int>(b));
    return zyx(c.transpose() * local(b) * c);
  };
  q.head<3>() = pose.position;
  const Matrix3d& g = pose.root;
  q[3] = std::asin(std::clamp(-g(1, 2), -1.0, 1.0));
  q[4] = std::atan2(g(0, 2), g(2, 2));
  q[5] = std::atan2(g(1, 0), g(1, 1));
  if (previous) q[4] += 2 * std::numbers::pi * std::round(((*previous)[4] - q[4]) / (2 * std::numbers::pi));

  q.segment<3>(24) = angles(lfemur);
  q[27] = angles(ltibia)[0];
  q[28] = angles(lfoot)[0], q[29] = angles(lfoot)[2];
  q.segment<3>(30) = angles(rfemur);
  q[33] = angles(rtibia)[0];
  q[34] = angles(rfoot)[0], q[35] = angles(rfoot)[2];

  q.segment<3>(6) = zyx(local(lowerback) * local(upperback) * local(thorax));
  q[9] = angles(lclavicle)[1], q[10] = angles(lclavicle)[2];
  q.segment<3>(11) = angles(lhumerus);
  q[14] = angles(lradius)[0];
  q[15] = angles(rclavicle)[1], q[16] = angles(rclavicle)[2];
  q.segment<3>(17) = angles(rhumerus);
  q[20] = angles(rradius)[0];
  // Neck and head together are Z(rz) X(rx) Y(ry).
  const Matrix3d n = local(lowerneck) * local(upperneck) * local(head);
  q[21] = std::asin(std::clamp(n(2, 1), -1.0, 1.0));
  q[22] = std::atan2(-n(0, 1), n(1, 1));
  q[23] = std::atan2(-n(2, 0), n(2, 2));
  refine(q, full_points(pose));
  // Angles near half a turn may come out on either side: the one near the frame before is meant.
  if (previous)
    for (int k = 3; k < fit::kDofs; ++k)
      if (k != 4) q[k] += 2 * std::numbers::pi * std::round(((*previous)[k] - q[k]) / (2 * std::numbers::pi));
  return q;
}

}  // namespace booth::daemon

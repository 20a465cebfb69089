// Gauss-Newton on the directions of the left limbs; the right ones are their mirror image.
#include "fit/train/rest_pose.hpp"

#include <Eigen/Cholesky>
#include <array>

namespace booth::fit::train {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;
// Median pitch of 1,467 frames of standing at ease: pelvis 5.3, chest 5.0, neck 3.5 degrees forward.
constexpr double kPelvisPitch = 5.0 * kDegree, kNeckPitch = -1.5 * kDegree;
constexpr double kPull = 0.02;  // against directions of unit length: 1 degree costs as much as 0.02 degrees of direction

constexpr std::array<std::string_view, 5> kLimbs{"lhumerus", "lradius", "lfemur", "ltibia", "ltoes"};
constexpr std::array<int, 10> kDofsSolved{11, 12, 13, 14, 24, 25, 26, 27, 28, 29};

}  // namespace

PoseVector solve_rest_pose(const Points3& rest_joints) {
  const auto& neutral = average_bone_vectors();
  const auto residual = [&](const PoseVector& q) {
    Kinematics kin;
    forward_kinematics(q, neutral, kin);
    Eigen::Matrix<double, 3 * kLimbs.size() + kDofsSolved.size(), 1> r;
    for (std::size_t i = 0; i < kLimbs.size(); ++i) {
      const int b = bone_index(kLimbs[i]);
      const Eigen::Vector3d direction = (rest_joints.col(b) - rest_joints.col(bones()[static_cast<std::size_t>(b)].parent)).normalized();
      r.segment<3>(static_cast<Eigen::Index>(3 * i)) = kin.rotation[static_cast<std::size_t>(b)] * neutral.col(b).normalized() - direction;
    }
    for (std::size_t i = 0; i < kDofsSolved.size(); ++i) r[static_cast<Eigen::Index>(3 * kLimbs.size() + i)] = kPull * q[kDofsSolved[i]];
    return r;
  };
  PoseVector q = PoseVector::Zero();
  q[3] = kPelvisPitch;
  q[21] = kNeckPitch;
  q[13] = 45 * kDegree;  // an A-pose
  q[14] = 30 * kDegree;
  for (int step = 0; step < 50; ++step) {
    const auto r = residual(q);
    Eigen::MatrixXd jacobian(r.size(), kDofsSolved.size());
    for (std::size_t i = 0; i < kDofsSolved.size(); ++i) {
      PoseVector shifted = q;
      shifted[kDofsSolved[i]] += 1e-6;
      jacobian.col(static_cast<Eigen::Index>(i)) = (residual(shifted) - r) / 1e-6;
    }
    Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
    normal.diagonal().array() += 1e-9;
    const Eigen::VectorXd delta = normal.ldlt().solve(-jacobian.transpose() * r);
    for (std::size_t i = 0; i < kDofsSolved.size(); ++i) q[kDofsSolved[i]] += delta[static_cast<Eigen::Index>(i)];
    if (delta.norm() < 1e-12) break;
  }
  const PoseVector other = mirror(q);
  q.segment<6>(15) = other.segment<6>(15);
  q.segment<6>(30) = other.segment<6>(30);
  return q;
}

}  // namespace booth::fit::train

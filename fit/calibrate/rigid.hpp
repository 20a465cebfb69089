// Rigid motions in double precision and the small steps by which least squares moves them.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace booth::fit::calibrate {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// x_to = rotation * x_from + translation; metres. Named to_from: camera_from_board takes points of the board into the camera.
struct Rigid {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const { return rotation * p + translation; }
  Rigid operator*(const Rigid& o) const { return {rotation * o.rotation, rotation * o.translation + translation}; }
  Rigid inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation)}; }
};

/// [a]_x, so that cross_matrix(a) * b = a x b.
inline Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& a) { return (Eigen::Matrix3d() << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0).finished(); }

/// The rotation by |w| radians about w.
inline Eigen::Matrix3d rotation_by(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  return angle < 1e-12 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity() + cross_matrix(w)) : Eigen::AngleAxisd(angle, w / angle).toRotationMatrix();
}

/// One step: three radians that turn from the left, three metres that shift. Rotation and translation do not mix.
inline Rigid stepped(const Rigid& pose, const Vector6& step) {
  // Re-orthonormalised, so that hundreds of steps leave a rotation.
  const Eigen::Quaterniond q(rotation_by(step.head<3>()) * pose.rotation);
  return {q.normalized().toRotationMatrix(), pose.translation + step.tail<3>()};
}

/// Radians between two attitudes, 0 to pi.
inline double angle_between(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) { return Eigen::AngleAxisd(a.transpose() * b).angle(); }

}  // namespace booth::fit::calibrate

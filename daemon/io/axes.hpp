// The one place where points change between the estimator's axes and those of files.
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace booth::daemon {

/// Which axis of a file points up.
///   z: the booth frame (x forward, y left, z up); the default of every file we read and write.
///   y: the CMU frame that the estimator thinks in (y up, z forward, x left). glTF and BVH have their y axis up by convention, so those two are
///      always written so: glTF's own axes (y up, z forward) ARE the CMU frame.
enum class UpAxis : std::uint8_t { z, y };

/// 3 x N points (or directions), from the file's axes to the CMU frame and back. Turning axes is exact: values only change places.
template <typename Derived>
Eigen::Matrix<typename Derived::Scalar, 3, Eigen::Dynamic> cmu_from_file(const Eigen::MatrixBase<Derived>& p, UpAxis up) {
  if (up == UpAxis::y) return p;
  Eigen::Matrix<typename Derived::Scalar, 3, Eigen::Dynamic> out(3, p.cols());
  out << p.row(1), p.row(2), p.row(0);
  return out;
}

template <typename Derived>
Eigen::Matrix<typename Derived::Scalar, 3, Eigen::Dynamic> file_from_cmu(const Eigen::MatrixBase<Derived>& p, UpAxis up) {
  if (up == UpAxis::y) return p;
  Eigen::Matrix<typename Derived::Scalar, 3, Eigen::Dynamic> out(3, p.cols());
  out << p.row(2), p.row(0), p.row(1);
  return out;
}

}  // namespace booth::daemon

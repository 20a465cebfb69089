// Homography (Zhang 2000, section 2), its mirror image about the line of sight, and a refinement of both.
#include "fit/calibrate/board_pose.hpp"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

namespace booth::fit::calibrate {
namespace {

/// The homography from board (x, y, metres) to the plane z = 1, up to scale; points are centred and scaled first (Hartley).
std::optional<Eigen::Matrix3d> homography(const Eigen::Matrix2Xd& from, const Eigen::Matrix2Xd& to) {
  const auto normaliser = [](const Eigen::Matrix2Xd& p) {
    const Eigen::Vector2d mean = p.rowwise().mean();
    const double spread = std::sqrt((p.colwise() - mean).squaredNorm() / static_cast<double>(p.cols()));
    Eigen::Matrix3d t = Eigen::Matrix3d::Identity();
    t.topLeftCorner<2, 2>() /= spread;
    t.topRightCorner<2, 1>() = -mean / spread;
    return t;
  };
  const Eigen::Matrix3d tf = normaliser(from), tt = normaliser(to);
  if (!tf.allFinite() || !tt.allFinite()) return std::nullopt;
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(2 * from.cols(), 9);
  for (Eigen::Index i = 0; i < from.cols(); ++i) {
    const Eigen::Vector3d f = tf * from.col(i).homogeneous(), t = tt * to.col(i).homogeneous();
    a.block<1, 3>(2 * i, 0) = f.transpose();
    a.block<1, 3>(2 * i, 6) = -t.x() * f.transpose();
    a.block<1, 3>(2 * i + 1, 3) = f.transpose();
    a.block<1, 3>(2 * i + 1, 6) = -t.y() * f.transpose();
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeFullV);
  if (svd.singularValues()[7] < 1e-9 * svd.singularValues()[0]) return std::nullopt;  // corners on a line
  const Eigen::Matrix<double, 9, 1> h = svd.matrixV().col(8);
  const Eigen::Matrix3d normal = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(h.data());
  return Eigen::Matrix3d(tt.inverse() * normal * tf);
}

std::optional<Rigid> from_homography(Eigen::Matrix3d h) {
  const double scale = 0.5 * (h.col(0).norm() + h.col(1).norm());
  if (!(scale > 0) || !h.allFinite()) return std::nullopt;
  h /= h(2, 2) < 0 ? -scale : scale;
  if (!(h(2, 2) > 0)) return std::nullopt;
  Eigen::Matrix3d r;
  r << h.col(0), h.col(1), h.col(0).cross(h.col(1));
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(r, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) *= -1;
  return Rigid{u * svd.matrixV().transpose(), h.col(2)};
}

/// The other pose that looks almost the same: the board's normal mirrored about the line of sight.
Rigid mirrored(const Rigid& pose) {
  const Eigen::Vector3d sight = pose.translation.normalized(), normal = pose.rotation.col(2);
  const Eigen::Vector3d other = 2 * sight.dot(normal) * sight - normal;
  const Eigen::Matrix3d turn = Eigen::Quaterniond::FromTwoVectors(normal, other).toRotationMatrix();
  return {turn * pose.rotation, pose.translation};
}

double squares(const Lens& lens, const Board& board, const Sighting& s, const Rigid& pose) {
  double sum = 0;
  for (std::size_t i = 0; i < s.corner.size(); ++i) {
    const Eigen::Vector3d p = pose * board.corner(s.corner[i]);
    if (p.z() < 1e-3) return std::numeric_limits<double>::infinity();
    sum += (lens.project(p) - s.pixel.col(static_cast<Eigen::Index>(i))).squaredNorm();
  }
  return sum;
}

double refine(const Lens& lens, const Board& board, const Sighting& s, Rigid& pose) {
  double cost = squares(lens, board, s, pose), damping = 1e-4;
  for (int iteration = 0; iteration < 30 && std::isfinite(cost); ++iteration) {
    Matrix6 h = Matrix6::Zero();
    Vector6 g = Vector6::Zero();
    for (std::size_t i = 0; i < s.corner.size(); ++i) {
      const Eigen::Vector3d arm = pose.rotation * board.corner(s.corner[i]);
      Eigen::Matrix<double, 2, 3> by_point;
      const Eigen::Vector2d r = lens.project(arm + pose.translation, &by_point) - s.pixel.col(static_cast<Eigen::Index>(i));
      Eigen::Matrix<double, 2, 6> j;
      j << by_point * -cross_matrix(arm), by_point;
      h += j.transpose() * j;
      g += j.transpose() * r;
    }
    Matrix6 damped = h;
    damped.diagonal() *= 1 + damping;
    const Vector6 step = -damped.ldlt().solve(g);
    if (!step.allFinite()) break;
    const Rigid next = stepped(pose, step);
    const double there = squares(lens, board, s, next);
    if (there < cost) {
      const bool settled = cost - there < 1e-10 * cost;
      pose = next, cost = there, damping = std::max(damping * 0.2, 1e-9);
      if (settled) break;
    } else {
      damping *= 10;
      if (damping > 1e6) break;
    }
  }
  return cost;
}

/// Median distance of the measured depth from the plane, metres; a constant offset of all depth counts alike for both poses.
double depth_disagreement(const Rigid& pose, const std::vector<DepthSample>& depth) {
  std::vector<double> off;
  for (const DepthSample& d : depth)
    if (const double z = depth_of_plane(pose, d.x, d.y); std::isfinite(z)) off.push_back(d.z - z);
  if (off.size() < 3) return std::numeric_limits<double>::infinity();
  const auto middle = off.begin() + static_cast<std::ptrdiff_t>(off.size() / 2);
  std::nth_element(off.begin(), middle, off.end());
  const double shift = *middle;
  for (double& o : off) o = std::abs(o - shift);
  std::nth_element(off.begin(), middle, off.end());
  return *middle;
}

}  // namespace

double depth_of_plane(const Rigid& camera_from_board, double x, double y) {
  const Eigen::Vector3d n = camera_from_board.rotation.col(2);
  const double along = n.dot(Eigen::Vector3d(x, y, 1)), z = n.dot(camera_from_board.translation) / along;
  return std::abs(along) > 1e-9 && z > 0 ? z : std::numeric_limits<double>::quiet_NaN();
}

std::optional<BoardPose> pose_of_board(const Lens& lens, const Board& board, const Sighting& s) {
  const auto count = static_cast<Eigen::Index>(s.corner.size());
  if (count < 6 || s.pixel.cols() != count || !s.pixel.allFinite()) return std::nullopt;
  Eigen::Matrix2Xd flat(2, count), seen(2, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    flat.col(i) = board.corner(s.corner[static_cast<std::size_t>(i)]).head<2>();
    seen.col(i) = lens.ray(s.pixel.col(i));
  }
  const auto h = homography(flat, seen);
  const auto start = h ? from_homography(*h) : std::nullopt;
  if (!start) return std::nullopt;
  Rigid first = *start;
  double first_cost = refine(lens, board, s, first);
  Rigid second = mirrored(first);
  double second_cost = refine(lens, board, s, second);
  // A print is seen from its front only.
  const auto behind = [](const Rigid& p) { return p.rotation.col(2).dot(p.translation) > 0; };
  if (behind(second)) second_cost = std::numeric_limits<double>::infinity();
  if (behind(first)) first_cost = std::numeric_limits<double>::infinity();
  if (second_cost < first_cost) std::swap(first, second), std::swap(first_cost, second_cost);
  if (!std::isfinite(first_cost)) return std::nullopt;
  // Corners alone decide only where the worse pose is clearly worse.
  constexpr double kClearlyWorse = 4;
  if (second_cost < kClearlyWorse * first_cost + 0.01 * static_cast<double>(count) &&
      depth_disagreement(second, s.depth) < 0.7 * depth_disagreement(first, s.depth))
    std::swap(first, second), std::swap(first_cost, second_cost);
  return BoardPose{first, std::sqrt(first_cost / static_cast<double>(count))};
}

int drop_strays(const Lens& lens, const Board& board, double stray_px, std::size_t least, Sighting& sighting) {
  const auto without = [&](std::size_t left_out) {
    Sighting rest;
    rest.depth = sighting.depth;
    rest.pixel.resize(2, sighting.pixel.cols() - 1);
    for (std::size_t i = 0; i < sighting.corner.size(); ++i) {
      if (i == left_out) continue;
      rest.pixel.col(static_cast<Eigen::Index>(rest.corner.size())) = sighting.pixel.col(static_cast<Eigen::Index>(i));
      rest.corner.push_back(sighting.corner[i]);
    }
    return rest;
  };
  int dropped = 0;
  while (sighting.corner.size() > std::max<std::size_t>(least, 7)) {
    const auto all = pose_of_board(lens, board, sighting);
    if (!all) break;
    const auto off = [&](const Rigid& pose, std::size_t i) {
      return (lens.project(pose * board.corner(sighting.corner[i])) - sighting.pixel.col(static_cast<Eigen::Index>(i))).norm();
    };
    std::size_t worst = 0;
    for (std::size_t i = 1; i < sighting.corner.size(); ++i)
      if (off(all->camera_from_board, i) > off(all->camera_from_board, worst)) worst = i;
    Sighting rest = without(worst);
    const auto pose = pose_of_board(lens, board, rest);
    if (!pose || off(pose->camera_from_board, worst) <= stray_px) break;
    sighting.corner = std::move(rest.corner);
    sighting.pixel = std::move(rest.pixel);
    ++dropped;
  }
  return dropped;
}

}  // namespace booth::fit::calibrate

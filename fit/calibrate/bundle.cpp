// Levenberg-Marquardt over poses and depth corrections, the boards eliminated view by view.
#include "fit/calibrate/bundle.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace booth::fit::calibrate {
namespace {

constexpr int kCameraUnknowns = 8;  // three turns, three shifts, gain, offset
using CameraBlock = Eigen::Matrix<double, 8, 8>;
using MixedBlock = Eigen::Matrix<double, 8, 6>;
using CameraStep = Eigen::Matrix<double, 8, 1>;

/// Sums of one picture: J^T W J and J^T W r by camera and board.
struct Block {
  CameraBlock camera = CameraBlock::Zero();
  MixedBlock mixed = MixedBlock::Zero();
  Matrix6 board = Matrix6::Zero();
  CameraStep camera_gradient = CameraStep::Zero();
  Vector6 board_gradient = Vector6::Zero();
  double cost = 0;
};

struct Robust {
  double weight, cost;
};
Robust huber(double size, double limit) { return size <= limit ? Robust{1, size * size} : Robust{limit / size, 2 * limit * size - limit * limit}; }

template <int Rows>
void add(Block& block, const Eigen::Matrix<double, Rows, 8>& by_camera, const Eigen::Matrix<double, Rows, 6>& by_board,
         const Eigen::Matrix<double, Rows, 1>& residual, double weight) {
  block.camera.noalias() += weight * by_camera.transpose() * by_camera;
  block.mixed.noalias() += weight * by_camera.transpose() * by_board;
  block.board.noalias() += weight * by_board.transpose() * by_board;
  block.camera_gradient.noalias() += weight * by_camera.transpose() * residual;
  block.board_gradient.noalias() += weight * by_board.transpose() * residual;
}

/// `slopes` false: the cost only.
Block linearise(const Lens& lens, const Board& board, const Sighting& s, const BundleSettings& settings, const Rigid& camera, const Rigid& base_from_board,
                const DepthCorrection& depth, bool slopes) {
  Block block;
  const Eigen::Matrix3d& rc = camera.rotation;
  for (std::size_t i = 0; i < s.corner.size(); ++i) {
    const Eigen::Vector3d board_arm = base_from_board.rotation * board.corner(s.corner[i]);
    const Eigen::Vector3d camera_arm = rc * (board_arm + base_from_board.translation), p = camera_arm + camera.translation;
    if (p.z() < 1e-2) {  // behind the camera: no derivative leads back, but the step that led here must not be taken
      block.cost = std::numeric_limits<double>::infinity();
      return block;
    }
    Eigen::Matrix<double, 2, 3> by_point;
    const Eigen::Vector2d residual = (lens.project(p, slopes ? &by_point : nullptr) - s.pixel.col(static_cast<Eigen::Index>(i))) / settings.corner_sigma;
    const Robust robust = huber(residual.norm(), settings.robust);
    block.cost += robust.cost;
    if (!slopes) continue;
    by_point /= settings.corner_sigma;
    Eigen::Matrix<double, 2, 8> by_camera = Eigen::Matrix<double, 2, 8>::Zero();
    by_camera.leftCols<3>() = by_point * -cross_matrix(camera_arm);
    by_camera.middleCols<3>(3) = by_point;
    Eigen::Matrix<double, 2, 6> by_board;
    by_board.leftCols<3>() = by_point * rc * -cross_matrix(board_arm);
    by_board.rightCols<3>() = by_point * rc;
    add<2>(block, by_camera, by_board, residual, robust.weight);
  }
  const double sigma = settings.depth_sigma * std::sqrt(std::max(1.0, static_cast<double>(s.depth.size()) / settings.depth_samples));
  const Rigid pose = camera * base_from_board;
  const Eigen::Vector3d normal = pose.rotation.col(2), turned = rc * base_from_board.translation;
  for (const DepthSample& d : s.depth) {
    const Eigen::Vector3d ray(d.x, d.y, 1);
    const double along = normal.dot(ray);
    if (std::abs(along) < 0.05) continue;  // edge-on
    const double z = normal.dot(pose.translation) / along;
    const Eigen::Matrix<double, 1, 1> residual((depth.read(z) - d.z) / sigma);
    const Robust robust = huber(std::abs(residual[0]), settings.robust);
    block.cost += robust.cost;
    if (!slopes) continue;
    const double scale = (1 + depth.gain) / (along * sigma);
    const Eigen::Vector3d lever = normal.cross(pose.translation - z * ray);
    Eigen::Matrix<double, 1, 8> by_camera;
    by_camera << scale * (lever + turned.cross(normal)).transpose(), scale * normal.transpose(), z / sigma, 1 / sigma;
    Eigen::Matrix<double, 1, 6> by_board;
    by_board << scale * (rc.transpose() * lever).transpose(), scale * (rc.transpose() * normal).transpose();
    add<1>(block, by_camera, by_board, residual, robust.weight);
  }
  return block;
}

struct Problem {
  std::span<const Lens> lenses;
  const Board& board;
  std::span<const Sighting> sightings;
  const BundleSettings& settings;
  std::vector<char> takes_part;
  int cameras, views;

  Block linearised(std::size_t i, const BundleState& x, bool slopes) const {
    const auto c = static_cast<std::size_t>(sightings[i].camera), v = static_cast<std::size_t>(sightings[i].view);
    return linearise(lenses[c], board, sightings[i], settings, x.camera[c], x.board[v], x.depth[c], slopes);
  }
  double prior(const DepthCorrection& d) const {
    return d.gain * d.gain / (settings.gain_sigma * settings.gain_sigma) + d.offset * d.offset / (settings.offset_sigma * settings.offset_sigma);
  }
  double cost(const BundleState& x) const {
    double sum = 0;
    for (std::size_t i = 0; i < sightings.size(); ++i)
      if (takes_part[i]) sum += linearised(i, x, false).cost;
    for (const DepthCorrection& d : x.depth) sum += prior(d);
    return sum;
  }
};

/// The normal equations with the boards still in them.
struct Normal {
  Eigen::MatrixXd camera;           // 8C x 8C, block diagonal before elimination
  Eigen::VectorXd camera_gradient;  // 8C
  std::vector<Matrix6> board;       // by view
  std::vector<Vector6> board_gradient;
  std::vector<Eigen::Matrix<double, Eigen::Dynamic, 6>> mixed;  // 8C x 6, by view
};

Normal normal_equations(const Problem& p, const BundleState& x) {
  const Eigen::Index size = kCameraUnknowns * p.cameras;
  const auto views = static_cast<std::size_t>(p.views);
  Normal n{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size), std::vector<Matrix6>(views, Matrix6::Zero()),
           std::vector<Vector6>(views, Vector6::Zero()), std::vector<Eigen::Matrix<double, Eigen::Dynamic, 6>>(views)};
  for (auto& m : n.mixed) m.setZero(size, 6);
  for (std::size_t i = 0; i < p.sightings.size(); ++i) {
    if (!p.takes_part[i]) continue;
    const Block b = p.linearised(i, x, true);
    const Eigen::Index at = kCameraUnknowns * p.sightings[i].camera;
    const auto v = static_cast<std::size_t>(p.sightings[i].view);
    n.camera.block<8, 8>(at, at) += b.camera;
    n.camera_gradient.segment<8>(at) += b.camera_gradient;
    n.board[v] += b.board;
    n.board_gradient[v] += b.board_gradient;
    n.mixed[v].middleRows<8>(at) += b.mixed;
  }
  for (int c = 0; c < p.cameras; ++c) {
    const Eigen::Index at = kCameraUnknowns * c;
    const double gain = 1 / (p.settings.gain_sigma * p.settings.gain_sigma), offset = 1 / (p.settings.offset_sigma * p.settings.offset_sigma);
    n.camera(at + 6, at + 6) += gain;
    n.camera(at + 7, at + 7) += offset;
    n.camera_gradient[at + 6] += gain * x.depth[static_cast<std::size_t>(c)].gain;
    n.camera_gradient[at + 7] += offset * x.depth[static_cast<std::size_t>(c)].offset;
  }
  return n;
}

struct Reduced {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd right;
};

/// Schur complement; the base camera's pose and whatever nobody observes stay where they are.
Reduced eliminate(const Normal& n, double damping) {
  Reduced r{n.camera, -n.camera_gradient};
  r.matrix.diagonal() *= 1 + damping;
  for (std::size_t v = 0; v < n.board.size(); ++v) {
    Matrix6 b = n.board[v];
    b.diagonal() *= 1 + damping;
    b.diagonal().array() += 1e-9;
    const Eigen::LDLT<Matrix6> solver(b);
    const Eigen::Matrix<double, 6, Eigen::Dynamic> solved = solver.solve(n.mixed[v].transpose());
    r.matrix.noalias() -= n.mixed[v] * solved;
    r.right.noalias() += solved.transpose() * n.board_gradient[v];
  }
  const auto hold = [&](Eigen::Index k) {
    r.matrix.row(k).setZero(), r.matrix.col(k).setZero();
    r.matrix(k, k) = 1, r.right[k] = 0;
  };
  for (Eigen::Index k = 0; k < 6; ++k) hold(k);
  for (Eigen::Index k = 6; k < r.matrix.rows(); ++k)
    if (!(n.camera(k, k) > 1e-9)) hold(k);
  return r;
}

BundleState moved(const Normal& n, const Eigen::VectorXd& step, double damping, const BundleState& x) {
  BundleState out = x;
  for (std::size_t c = 0; c < x.camera.size(); ++c) {
    const auto at = static_cast<Eigen::Index>(kCameraUnknowns * c);
    out.camera[c] = stepped(x.camera[c], step.segment<6>(at));
    out.depth[c].gain += step[at + 6];
    out.depth[c].offset += step[at + 7];
  }
  for (std::size_t v = 0; v < x.board.size(); ++v) {
    Matrix6 b = n.board[v];
    b.diagonal() *= 1 + damping;
    b.diagonal().array() += 1e-9;
    out.board[v] = stepped(x.board[v], b.ldlt().solve(-n.board_gradient[v] - n.mixed[v].transpose() * step));
  }
  return out;
}

}  // namespace

BundleState state_of(const Start& start) {
  BundleState out;
  for (const auto& c : start.camera) out.camera.push_back(c.value_or(Rigid{}));
  for (const auto& b : start.board) out.board.push_back(b.value_or(Rigid{}));
  out.depth.resize(out.camera.size());
  return out;
}

BundleReport adjust(std::span<const Lens> lenses, const Board& board, std::span<const Sighting> sightings, const BundleSettings& settings,
                    std::span<const char> leave_out, BundleState& x) {
  Problem problem{
      lenses, board, sightings, settings, std::vector<char>(sightings.size(), 1), static_cast<int>(x.camera.size()), static_cast<int>(x.board.size())};
  for (std::size_t i = 0; i < sightings.size(); ++i)
    if (i < leave_out.size() && leave_out[i]) problem.takes_part[i] = 0;

  BundleReport report;
  report.cost = problem.cost(x);
  double damping = 1e-3;
  Normal normal = normal_equations(problem, x);
  while (report.iterations < settings.iterations && std::isfinite(report.cost)) {
    ++report.iterations;
    const Reduced reduced = eliminate(normal, damping);
    const Eigen::VectorXd step = reduced.matrix.ldlt().solve(reduced.right);
    const BundleState next = moved(normal, step, damping, x);
    const double cost = step.allFinite() ? problem.cost(next) : std::numeric_limits<double>::infinity();
    if (cost <= report.cost) {
      const bool settled = report.cost - cost <= 1e-9 * report.cost + 1e-12;
      x = next;
      report.cost = cost;
      damping = std::max(damping * 0.1, 1e-10);
      if (settled) {
        report.converged = true;
        break;
      }
      normal = normal_equations(problem, x);
    } else {
      damping *= 10;
      if (damping > 1e8) {
        report.converged = true;  // no step in any direction helps
        break;
      }
    }
  }

  double squares = 0;
  std::size_t corners = 0;
  report.rms_px.assign(sightings.size(), std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    if (!problem.takes_part[i]) continue;
    const Sighting& s = sightings[i];
    const Rigid pose = x.camera[static_cast<std::size_t>(s.camera)] * x.board[static_cast<std::size_t>(s.view)];
    double sum = 0;
    for (std::size_t k = 0; k < s.corner.size(); ++k)
      sum += (lenses[static_cast<std::size_t>(s.camera)].project(pose * board.corner(s.corner[k])) - s.pixel.col(static_cast<Eigen::Index>(k))).squaredNorm();
    report.rms_px[i] = std::sqrt(sum / static_cast<double>(std::max<std::size_t>(s.corner.size(), 1)));
    squares += sum, corners += s.corner.size();
  }
  const Eigen::Index cameras = problem.cameras;
  const double scale = corners > 0 ? std::max(1.0, squares / (2.0 * static_cast<double>(corners) * settings.corner_sigma * settings.corner_sigma)) : 1;
  const Reduced at_end = eliminate(normal_equations(problem, x), 0);
  const Eigen::MatrixXd inverse = at_end.matrix.ldlt().solve(Eigen::MatrixXd::Identity(at_end.matrix.rows(), at_end.matrix.rows()));
  report.covariance.setZero(6 * cameras, 6 * cameras);
  for (Eigen::Index a = 1; a < cameras; ++a)
    for (Eigen::Index b = 1; b < cameras; ++b)
      report.covariance.block<6, 6>(6 * a, 6 * b) = scale * inverse.block<6, 6>(kCameraUnknowns * a, kCameraUnknowns * b);
  return report;
}

double place_board(std::span<const Lens> lenses, const Board& board, std::span<const Sighting* const> sightings, const BundleSettings& settings,
                   const BundleState& x, Rigid& base_from_board) {
  const auto sum = [&](const Rigid& pose, bool slopes) {
    Block total;
    for (const Sighting* s : sightings) {
      const auto c = static_cast<std::size_t>(s->camera);
      const Block b = linearise(lenses[c], board, *s, settings, x.camera[c], pose, x.depth[c], slopes);
      total.board += b.board, total.board_gradient += b.board_gradient, total.cost += b.cost;
    }
    return total;
  };
  double cost = sum(base_from_board, false).cost, damping = 1e-3;
  for (int i = 0; i < settings.iterations && std::isfinite(cost) && damping < 1e8;) {
    const Block b = sum(base_from_board, true);
    while (damping < 1e8 && i++ < settings.iterations) {
      Matrix6 h = b.board;
      h.diagonal() *= 1 + damping;
      const Rigid next = stepped(base_from_board, h.ldlt().solve(-b.board_gradient));
      const double there = sum(next, false).cost;
      if (there <= cost) {
        const bool settled = cost - there <= 1e-9 * cost + 1e-12;
        base_from_board = next, cost = there, damping = std::max(damping * 0.1, 1e-10);
        if (settled) return cost;
        break;
      }
      damping *= 10;
    }
  }
  return cost;
}

}  // namespace booth::fit::calibrate

// Ceres' Levenberg-Marquardt on the same energy written as squares: residual r / sqrt(|r|) for each term that eq. 5 and 6 do not square.
#include <ceres/ceres.h>

#include "fit/body/poser.hpp"
#include "fit/track/paper_fitter.hpp"
#include "tests/bench/fit/problem.hpp"

namespace booth::bench {
namespace {

constexpr double kSmallest = 1e-4;  ///< m, below which a distance counts as this, so that its root has a derivative

/// 1/2 |residuals|^2 = eq. 4. Derivatives hold the nearest points, normals and roots fixed, as Gauss-Newton on such energies does.
class PaperResiduals final : public ceres::CostFunction {
 public:
  explicit PaperResiduals(Problem& problem)
      : problem_(problem), poser_(problem.model(), problem.pack().shape_count(), fit::PaperFitter::kVertices), shape_(problem.pack().shape_count()) {
    mutable_parameter_block_sizes()->push_back(problem.dimensions());
    set_num_residuals(4 * poser_.size() + shape_ + kLimbs + fit::kPoseDofs);
    const auto& components = problem.prior().components;
    outside_ = Eigen::MatrixXd::Identity(fit::kPoseDofs, fit::kPoseDofs) - components * components.transpose();
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Unknowns x = problem_.absolute({parameters[0], static_cast<std::size_t>(problem_.dimensions())});
    place(x);
    const int n = problem_.dimensions();
    double* jacobian = jacobians != nullptr ? jacobians[0] : nullptr;
    if (jacobian != nullptr) {
      std::fill_n(jacobian, static_cast<std::size_t>(num_residuals()) * static_cast<std::size_t>(n), 0.0);
      poser_.prepare_shape_derivatives();
    }
    const fit::PaperWeights w;
    // Metres summed over the vertices to millimetres summed over 1,000 (docs/design/energy.md).
    const double scale = fit::kMillimetres * fit::kPaperVertices / poser_.size();
    int row = 0;
    for (int i = 0; i < poser_.size(); ++i) {
      const Eigen::Vector3f v = poser_.position(i), normal = poser_.normal(i);
      Eigen::Vector3f nearest;
      const bool known = problem_.field().nearest(v, nearest);
      const Eigen::Vector3f d = known ? Eigen::Vector3f(v - nearest) : Eigen::Vector3f::Zero();
      // Beyond the field's band the energy charges a constant.
      const double outside = static_cast<double>(fit::kChargedOutside);
      const double point = std::sqrt(2 * w.point * scale / std::max(kSmallest, static_cast<double>(d.norm())));
      for (int c = 0; c < 3; ++c, ++row) {
        residuals[row] = known ? point * static_cast<double>(d[c]) : c == 0 ? std::sqrt(2 * w.point * scale * outside) : 0.0;
        if (known && jacobian != nullptr) fill_row(i, Eigen::Vector3f::Unit(c), point, jacobian + static_cast<std::ptrdiff_t>(row) * n);
      }
      const auto along = static_cast<double>(normal.dot(d));
      const double plane = std::sqrt(2 * w.plane * scale / std::max(kSmallest, std::abs(along)));
      residuals[row] = known ? plane * along : std::sqrt(2 * w.plane * scale * outside);
      if (known && jacobian != nullptr) fill_row(i, normal, plane, jacobian + static_cast<std::ptrdiff_t>(row) * n);
      ++row;
    }
    priors(x, w, row, residuals, jacobian);
    return true;
  }

 private:
  static constexpr int kLimbs = static_cast<int>(fit::kLimbPairs.size());

  void place(const Unknowns& x) const {
    fit::PoseVector q;
    fit::ShapeVector beta(shape_);
    for (int k = 0; k < fit::kDofs; ++k) q[k] = x[static_cast<std::size_t>(k)];
    for (int k = 0; k < shape_; ++k) beta[k] = x[static_cast<std::size_t>(fit::kDofs + k)];
    poser_.set_shape(beta);
    poser_.set_pose(q);
  }
  double deviation(int k) const { return static_cast<double>(problem_.deviation()[static_cast<std::size_t>(k)]); }

  void fill_row(int vertex, const Eigen::Vector3f& direction, double factor, double* row) const {
    float buffer[fit::kDofs + 256] = {};
    poser_.pose_row(vertex, direction, buffer);
    poser_.shape_row(vertex, direction, buffer + fit::kDofs);
    for (int k = 0; k < problem_.dimensions(); ++k) row[k] = factor * static_cast<double>(buffer[k]) * deviation(k);
  }

  Eigen::Matrix<double, kLimbs, 1> limb_differences(const fit::ShapeVector& beta) const {
    const auto vectors = problem_.model().bone_vectors_from_joints(problem_.model().rest_joints(beta));
    Eigen::Matrix<double, kLimbs, 1> out;
    for (int l = 0; l < kLimbs; ++l) {
      const auto& [left, right] = fit::kLimbPairs[static_cast<std::size_t>(l)];
      out[l] = fit::kMillimetres * (vectors.col(left).norm() - vectors.col(right).norm());
    }
    return out;
  }

  void priors(const Unknowns& x, const fit::PaperWeights& w, int row, double* residuals, double* jacobian) const {
    const int n = problem_.dimensions();
    const auto at = [&](int r, int k) -> double& { return jacobian[static_cast<std::ptrdiff_t>(r) * n + k]; };
    fit::ShapeVector beta(shape_);
    for (int k = 0; k < shape_; ++k) {
      beta[k] = x[static_cast<std::size_t>(fit::kDofs + k)];
      residuals[row + k] = std::sqrt(2 * w.shape) * beta[k];
      if (jacobian != nullptr) at(row + k, fit::kDofs + k) = std::sqrt(2 * w.shape) * deviation(fit::kDofs + k);
    }
    row += shape_;
    const auto limbs = limb_differences(beta);
    for (int l = 0; l < kLimbs; ++l) residuals[row + l] = std::sqrt(2 * w.bone) * limbs[l];
    if (jacobian != nullptr) {
      for (int k = 0; k < shape_; ++k) {
        constexpr double kStep = 1e-3;
        fit::ShapeVector moved = beta;
        moved[k] += kStep;
        const Eigen::Matrix<double, kLimbs, 1> slope = (limb_differences(moved) - limbs) / kStep;
        for (int l = 0; l < kLimbs; ++l) at(row + l, fit::kDofs + k) = std::sqrt(2 * w.bone) * slope[l] * deviation(fit::kDofs + k);
      }
    }
    row += kLimbs;
    for (int a = 0; a < fit::kPoseDofs; ++a) {
      double away = 0;
      for (int b = 0; b < fit::kPoseDofs; ++b) {
        const int k = fit::kRootDofs + b;
        away += outside_(a, b) * (x[static_cast<std::size_t>(k)] - problem_.prior().mean[b]);
        if (jacobian != nullptr) at(row + a, k) = std::sqrt(2 * w.pose) * outside_(a, b) * deviation(k);
      }
      residuals[row + a] = std::sqrt(2 * w.pose) * away;
    }
  }

  Problem& problem_;
  mutable fit::Poser poser_;
  int shape_;
  Eigen::MatrixXd outside_;
};

/// Each accepted step is offered with the energy that all methods are judged by.
class Watch final : public ceres::IterationCallback {
 public:
  Watch(Problem& problem, const std::vector<double>& x) : problem_(problem), x_(x) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    try {
      (void)problem_.energy(x_);
      return ceres::SOLVER_CONTINUE;
    } catch (const TimeIsUp&) {
      return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    }
  }

 private:
  Problem& problem_;
  const std::vector<double>& x_;
};

void levenberg_marquardt(Problem& problem) {
  std::vector<double> x(static_cast<std::size_t>(problem.dimensions()), 0.0);
  ceres::Problem task;
  task.AddResidualBlock(new PaperResiduals(problem), nullptr, x.data());
  Watch watch(problem, x);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  options.max_num_iterations = 1000;
  options.max_solver_time_in_seconds = problem.time_limit();
  options.function_tolerance = 1e-6;
  options.callbacks.push_back(&watch);
  options.update_state_every_iteration = true;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &task, &summary);
}

}  // namespace

void add_ceres(std::vector<Method>& out) { out.push_back({"Levenberg-Marquardt", "Ceres", levenberg_marquardt}); }

}  // namespace booth::bench

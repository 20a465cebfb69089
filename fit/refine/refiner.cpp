// One refinement: collect rows from the cloud, from free space and from the priors; solve; accept or damp; repeat.
#include "fit/refine/refiner.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "fit/body/facet_fall.hpp"
#include "fit/body/sampling.hpp"
#include "fit/cloud/projection.hpp"
#include "fit/energy/terms.hpp"

namespace booth::fit {
namespace {

/// Geman-McClure: quadratic near zero, at most scale^2.
struct Robust {
  float scale2;
  float weight(float r2) const {
    const float t = 1 + r2 / scale2;
    return 1 / (t * t);
  }
  float cost(float r2) const { return r2 / (1 + r2 / scale2); }
};

constexpr float kFreeSpaceMargin = 0.03f;   // m before the measured surface that noise and thickness of clothes may take
constexpr float kBackgroundMargin = 0.05f;  // m
constexpr float kSilhouetteMargin = 2.0f;   // pixels that an eroded outline may lack
constexpr float kFreeSpaceScale = 0.15f;    // m; robust scale of free-space residuals
constexpr float kFloorScale = 0.05f;        // m
constexpr int kTangentialStep = 4;          // every so many points pull along the surface too, for all of them: a row costs the same whatever its weight
constexpr float kFacets = 0.7f;             // share of the facets' fall that is taken off: between the flat facets of a model and smooth skin
constexpr float kFarthestFall = 0.03f;      // m along the tangent plane; farther out nothing is known of the fall
constexpr float kNormalGate = 0.2f;         // cosine between a point's and a vertex's normal
constexpr double kFirstDamping = 1e-3, kMostDamping = 1e6;
constexpr double kLongestTurn = 0.35, kLongestMove = 0.15, kLongestShape = 1.0;  // of one step: rad, m, standard deviations
constexpr double kConverged = 2e-4;                                              // no unknown moves more: rad, m, standard deviations
constexpr double kNoGain = 2e-4;                                                 // of the energy that a step must take off to be worth another

/// Depth of the nearest surface that the pixels around (u, w) show, metres; infinite where they show none. At the outline of an arm before the trunk a
/// vertex of the arm may lie a pixel or two beside it without being in free space: taken for that, it would be pushed into the trunk.
float nearest_surface(const View& view, int u, int w) {
  constexpr std::array<std::array<int, 2>, 8> around{{{-3, 0}, {3, 0}, {0, -3}, {0, 3}, {-2, -2}, {2, -2}, {-2, 2}, {2, 2}}};
  float nearest = std::numeric_limits<float>::infinity();
  for (const auto& [du, dw] : around) {
    const int x = u + du, y = w + dw;
    if (x < 0 || y < 0 || x >= view.camera.width || y >= view.camera.height) continue;
    const float depth = view.depth[static_cast<std::size_t>(y * view.camera.width + x)];
    if (depth > 0) nearest = std::min(nearest, depth);
  }
  return nearest;
}

/// How much of `step` may be taken at once.
double step_fraction(const UnknownVector& step) {
  const double move = step.head<3>().cwiseAbs().maxCoeff() / kLongestMove;
  const double turn = step.segment(3, kDofs - 3).cwiseAbs().maxCoeff() / kLongestTurn;
  const double shape = step.size() > kDofs ? step.tail(step.size() - kDofs).cwiseAbs().maxCoeff() / kLongestShape : 0.0;
  return 1 / std::max({1.0, move, turn, shape});
}

}  // namespace

struct Refiner::Problem {
  const Observation& observation;
  const RefineWeights& weights;
  const RefineSchedule& schedule;
  const PoseBelief& pose_belief;
  const ShapeBelief& shape_belief;
  const Vertices* velocity;
  RefineSchedule::Stage stage;
  int cloud_samples, model_samples, valid_views;
};

Refiner::Refiner(const BodyModel& model, const PosePrior& prior, RefinerSize size, WorkerPool& pool)
    : prior_(prior),
      pool_(pool),
      poser_(model, size.shape_count, size.vertices),
      grid_(poser_.size()),
      cloud_grid_(kThinCloud),
      thin_(kThinCloud),
      x_(static_cast<std::size_t>(poser_.size())),
      model_samples_(std::min(size.model_samples, poser_.size())),
      portions_(kPortions) {
  const std::vector<float> fall = facet_fall(model.data());
  fall_.reserve(static_cast<std::size_t>(poser_.size()));
  for (int i = 0; i < poser_.size(); ++i) fall_.push_back(fall[static_cast<std::size_t>(poser_.model_vertex(i))]);
  shaped_ = ShapeVector::Zero(poser_.shape_count());
}

std::size_t Refiner::memory_bytes() const {
  return sizeof(*this) - sizeof(poser_) + poser_.memory_bytes() + grid_.memory_bytes() + cloud_grid_.memory_bytes() +
         kThinCloud * (6 * sizeof(float) + sizeof(std::uint8_t)) + (x_.size() + fall_.size()) * sizeof(float) +
         portions_.size() * (sizeof(Portion) + NormalEquations::heap_bytes());
}

void Refiner::collect(const Problem& problem, int portion, bool rows) {
  Portion& out = portions_[static_cast<std::size_t>(portion)];
  const int unknowns = kDofs + (problem.schedule.shape ? shape_count() : 0);
  out.equations.reset(unknowns);
  out.data = out.data_count = out.unexplained = out.violations = out.tested = out.energy = 0;
  const bool with_shape = problem.schedule.shape;
  const Observation& observation = problem.observation;
  const RefineWeights& weights = problem.weights;

  const auto add_row = [&](int vertex, const Eigen::Vector3f& direction, float residual, float weight) {
    if (!rows) return;
    const float root = std::sqrt(weight);
    float* row = out.equations.next_row();
    const Eigen::Vector3f scaled = root * direction;
    poser_.pose_row(vertex, scaled, row);
    if (with_shape) poser_.shape_row(vertex, scaled, row + kDofs);
    out.equations.commit(root * residual);
  };
  const auto range = [&](int count) { return std::pair{count * portion / kPortions, count * (portion + 1) / kPortions}; };

  // Cloud to model: every point lies on the body's surface.
  const Cloud& cloud = observation.cloud;
  const Robust robust{problem.stage.robust * problem.stage.robust};
  const int samples = problem.cloud_samples;
  const float data_weight = static_cast<float>(weights.effective_points / (std::max(samples, 1) * weights.sigma * weights.sigma));
  const float tangential = static_cast<float>(weights.tangential), cloth = static_cast<float>(weights.outside);
  const auto [first, last] = range(samples);
  for (int s = first; s < last; ++s) {
    const auto i = static_cast<std::size_t>(static_cast<std::int64_t>(s) * cloud.size / samples);
    const Eigen::Vector3f p(cloud.x[i], cloud.y[i], cloud.z[i]), pn(cloud.nx[i], cloud.ny[i], cloud.nz[i]);
    out.data_count += 1;
    const int v = pn.isZero() ? grid_.nearest(p, problem.stage.reach) : grid_.nearest(p, problem.stage.reach, pn, kNormalGate);
    if (v < 0) {
      out.data += static_cast<double>(cloth);
      out.unexplained += 1;
      out.energy += static_cast<double>(cloth * data_weight * robust.scale2);
      continue;
    }
    Eigen::Vector3f difference = poser_.position(v) - p;
    if (problem.velocity && !observation.views.empty()) difference += observation.views[cloud.camera[i]].time_offset * problem.velocity->col(v);
    const Eigen::Vector3f n = poser_.normal(v);
    const float above = n.dot(difference);
    const Eigen::Vector3f across = difference - above * n;
    const float length = across.norm();
    // Between its vertices the surface lies below their tangent planes. Who overlooks that makes every body too thin.
    const float along = above - kFacets * fall_[static_cast<std::size_t>(v)] * std::min(length, kFarthestFall);
    const float r2 = along * along + tangential * length * length;
    const float say = along < 0 ? cloth : 1.0f;
    const float w = say * data_weight * robust.weight(r2);
    out.data += static_cast<double>(say * robust.cost(r2) / robust.scale2);
    out.unexplained += r2 > robust.scale2;
    out.energy += static_cast<double>(say * data_weight * robust.cost(r2));
    add_row(v, n, along, w);
    if (tangential <= 0 || s % kTangentialStep != 0) continue;
    if (length > 1e-4f) add_row(v, across / length, length, w * tangential * kTangentialStep);
  }

  // Model to cloud, for clouds without images: a vertex whose side of the body was measured nearby belongs there.
  if (problem.schedule.model_to_cloud) {
    const float pull = static_cast<float>(weights.model_to_cloud / (problem.model_samples * weights.sigma * weights.sigma));
    const auto [begin, end] = range(problem.model_samples);
    for (int s = begin; s < end; ++s) {
      const int v = spread_vertex(s);
      if ((weights.unseen >> poser_.main_bone(v) & 1u) != 0) continue;
      const Eigen::Vector3f n = poser_.normal(v);
      const int c = cloud_grid_.nearest(poser_.position(v), problem.stage.reach, n, kNormalGate);
      if (c < 0) {
        out.energy += static_cast<double>(pull * robust.scale2);
        continue;
      }
      const Eigen::Vector3f difference = poser_.position(v) - Eigen::Vector3f(thin_.x[c], thin_.y[c], thin_.z[c]);
      const float r2 = difference.squaredNorm(), length = std::sqrt(r2);
      const float say = n.dot(difference) < 0 ? cloth : 1.0f;
      out.energy += static_cast<double>(say * pull * robust.cost(r2));
      if (length > 1e-4f) add_row(v, difference / length, length, say * pull * robust.weight(r2));
    }
  }

  // Model to images: no vertex may stand where a camera saw through.
  if (problem.valid_views > 0) {
    const Robust free_robust{kFreeSpaceScale * kFreeSpaceScale};
    const float free_weight = static_cast<float>(weights.free_space / (problem.model_samples * problem.valid_views * weights.sigma * weights.sigma));
    const auto [begin, end] = range(problem.model_samples);
    for (int s = begin; s < end; ++s) {
      const int v = spread_vertex(s);
      for (const View& view : observation.views) {
        if (!view.valid) continue;
        Eigen::Vector3f position = poser_.position(v);
        if (problem.velocity) position += view.time_offset * problem.velocity->col(v);
        const Pixel pixel = project(view.camera, position);
        const auto width = static_cast<float>(view.camera.width), height = static_cast<float>(view.camera.height);
        if (!(pixel.z > 0 && pixel.u > -0.5f && pixel.v > -0.5f && pixel.u < width - 0.5f && pixel.v < height - 0.5f)) continue;
        const int u = static_cast<int>(std::lround(pixel.u)), w = static_cast<int>(std::lround(pixel.v));
        const auto at = static_cast<std::size_t>(w * view.camera.width + u);
        const PixelLabel label = view.label[at];
        if (label == PixelLabel::unknown) continue;
        out.tested += 1;
        if (label == PixelLabel::person) {
          float before = view.depth[at] - kFreeSpaceMargin - pixel.z;  // how far before the seen surface
          if (before <= 0) continue;
          before = std::min(before, nearest_surface(view, u, w) - kFreeSpaceMargin - pixel.z);
          if (before <= 0) continue;
          out.violations += 1;
          out.energy += static_cast<double>(free_weight * free_robust.cost(before * before));
          add_row(v, view.camera.rotation.row(2).transpose(), -before, free_weight * free_robust.weight(before * before));
        } else if (pixel.z < view.depth[at] - kBackgroundMargin) {
          const auto cell = static_cast<std::size_t>((w / kSilhouetteStep) * silhouette_places(view.camera.width) + u / kSilhouetteStep);
          const float dx = view.nearest_dx[cell], dy = view.nearest_dy[cell];
          const float pixels = std::sqrt(dx * dx + dy * dy);
          if (pixels <= kSilhouetteMargin + kSilhouetteStep) continue;
          out.violations += 1;
          if (view.nearest_dx[cell] == kSilhouetteFar) {
            out.energy += static_cast<double>(free_weight * free_robust.scale2);
            continue;
          }
          const Eigen::Vector3f shift(dx / view.camera.fx * pixel.z, dy / view.camera.fy * pixel.z, 0);
          const float outside = shift.norm() * (1 - kSilhouetteMargin / pixels);
          const Eigen::Vector3f direction = view.camera.rotation.transpose() * (shift / shift.norm());
          out.energy += static_cast<double>(free_weight * free_robust.cost(outside * outside));
          add_row(v, direction, -outside, free_weight * free_robust.weight(outside * outside));
        }
      }
    }
  }

  // Nothing of the body is below the floor.
  if (observation.floor_known) {
    const float floor_weight = static_cast<float>(weights.floor / (problem.model_samples * weights.sigma * weights.sigma));
    const Robust floor_robust{kFloorScale * kFloorScale};
    const auto [begin, end] = range(problem.model_samples);
    for (int s = begin; s < end; ++s) {
      const int v = spread_vertex(s);
      const float below = observation.floor_height - poser_.y[static_cast<std::size_t>(v)];
      if (below <= 0) continue;
      out.energy += static_cast<double>(floor_weight * floor_robust.cost(below * below));
      add_row(v, Eigen::Vector3f::UnitY(), -below, floor_weight * floor_robust.weight(below * below));
    }
  }
}

void Refiner::add_priors(const Problem& problem, const PoseVector& q, const ShapeVector& beta, UnknownMatrix& h, UnknownVector& g, double& energy) const {
  const RefineWeights& weights = problem.weights;
  const PoseAngles d = q.tail<kPoseDofs>() - prior_.mean;

  // Distance from the subspace, and Mahalanobis distance inside it.
  const Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kPoseDofs, 1> w = prior_.components.transpose() * d;
  const PoseAngles outside = d - prior_.components * w;
  energy += weights.pose_outside * outside.squaredNorm();
  g.segment<kPoseDofs>(kRootDofs) += weights.pose_outside * outside;
  auto block = h.block<kPoseDofs, kPoseDofs>(kRootDofs, kRootDofs);
  block.diagonal().array() += weights.pose_outside;
  for (int k = 0; k < w.size(); ++k) {
    const double inside = weights.pose_inside / (prior_.sigma[k] * prior_.sigma[k]);
    energy += inside * w[k] * w[k];
    g.segment<kPoseDofs>(kRootDofs) += inside * w[k] * prior_.components.col(k);
    block.noalias() += (inside - weights.pose_outside) * prior_.components.col(k) * prior_.components.col(k).transpose();
  }

  for (int i = 0; i < kPoseDofs; ++i) {
    const double a = q[kRootDofs + i];
    const double beyond = a < prior_.lower[i] ? a - prior_.lower[i] : a > prior_.upper[i] ? a - prior_.upper[i] : 0.0;
    if (beyond == 0) continue;
    energy += weights.limits * beyond * beyond;
    g[kRootDofs + i] += weights.limits * beyond;
    h(kRootDofs + i, kRootDofs + i) += weights.limits;
  }

  for (int i = 0; i < kDofs; ++i) {
    const double difference = q[i] - problem.pose_belief.mean[i], inverse = problem.pose_belief.inverse_variance[i];
    energy += inverse * difference * difference;
    g[i] += inverse * difference;
    h(i, i) += inverse;
  }

  if (!problem.schedule.shape) return;
  const int n = shape_count();
  const ShapeVector off = beta - problem.shape_belief.mean;
  const ShapeVector pull = problem.shape_belief.information * off;
  energy += off.dot(pull);
  g.tail(n) += pull;
  h.bottomRightCorner(n, n) += problem.shape_belief.information;

  // Limbs are as long on the left as on the right.
  for (const auto& [left, right] : kLimbPairs) {
    const Eigen::Vector3d a = poser_.bone_vectors().col(left), b = poser_.bone_vectors().col(right);
    const double difference = a.norm() - b.norm();
    ShapeVector row(n);
    for (int k = 0; k < n; ++k) {
      const Points3& joints = poser_.model().joint_direction(k);
      const auto along = [&](int bone, const Eigen::Vector3d& v) {
        return v.normalized().dot(poser_.model().rest_rotation(bone).transpose() * (joints.col(bone) - joints.col(bones()[bone].parent)));
      };
      row[k] = along(left, a) - along(right, b);
    }
    energy += weights.bone * difference * difference;
    g.tail(n) += weights.bone * difference * row;
    h.bottomRightCorner(n, n).noalias() += weights.bone * row * row.transpose();
  }
}

void Refiner::fill_cloud_grid(const Cloud& cloud) {
  const int count = std::min<int>(cloud.size, cloud_grid_.capacity());
  for (int s = 0; s < count; ++s) {
    const auto i = static_cast<std::size_t>(static_cast<std::int64_t>(s) * cloud.size / count), o = static_cast<std::size_t>(s);
    for (auto [to, from] :
         {std::pair{&thin_.x, &cloud.x}, {&thin_.y, &cloud.y}, {&thin_.z, &cloud.z}, {&thin_.nx, &cloud.nx}, {&thin_.ny, &cloud.ny}, {&thin_.nz, &cloud.nz}})
      (*to)[o] = (*from)[i];
  }
  thin_.size = count;
  cloud_grid_.rebuild(thin_.x.data(), thin_.y.data(), thin_.z.data(), thin_.nx.data(), thin_.ny.data(), thin_.nz.data(), count);
}

void Refiner::fill_grid(BoneSet unseen) {
  const float* x = poser_.x.data();
  if (unseen != 0) {
    // A place that is no number leaves the vertex out of the grid.
    for (int v = 0; v < poser_.size(); ++v)
      x_[static_cast<std::size_t>(v)] =
          (unseen >> poser_.main_bone(v) & 1u) != 0 ? std::numeric_limits<float>::quiet_NaN() : poser_.x[static_cast<std::size_t>(v)];
    x = x_.data();
  }
  grid_.rebuild(x, poser_.y.data(), poser_.z.data(), poser_.nx.data(), poser_.ny.data(), poser_.nz.data(), poser_.size());
}

void Refiner::place(const PoseVector& q, const ShapeVector& beta) {
  if (beta != shaped_) {
    poser_.set_shape(beta);
    shaped_ = beta;
  }
  poser_.set_pose(q);
}

RefineReport Refiner::refine(const Observation& observation, const RefineWeights& weights, const RefineSchedule& schedule, const PoseBelief& pose_belief,
                             const ShapeBelief& shape_belief, const Vertices* velocity, PoseVector& q, ShapeVector& beta) {
  Problem problem{observation,
                  weights,
                  schedule,
                  pose_belief,
                  shape_belief,
                  velocity,
                  {},
                  std::min(schedule.cloud_samples, observation.cloud.size),
                  std::min(schedule.model_samples, model_samples_),
                  0};
  for (const View& view : observation.views) problem.valid_views += view.valid;
  const int unknowns = kDofs + (schedule.shape ? shape_count() : 0);

  if (schedule.model_to_cloud) fill_cloud_grid(observation.cloud);

  RefineReport report;
  const auto pose_at = [&](const PoseVector& pose, const ShapeVector& shape) {
    place(pose, shape);
    if (schedule.shape) poser_.prepare_shape_derivatives();
    fill_grid(weights.unseen);
  };
  const auto evaluate_here = [&](const PoseVector& pose, const ShapeVector& shape, bool rows) {
    pool_.run(kPortions, [&](int portion) { collect(problem, portion, rows); });
    Portion& sum = portions_[0];
    for (int p = 1; p < kPortions; ++p) {
      Portion& other = portions_[static_cast<std::size_t>(p)];
      sum.equations.add(other.equations);
      sum.data += other.data, sum.data_count += other.data_count;
      sum.unexplained += other.unexplained, sum.violations += other.violations, sum.tested += other.tested, sum.energy += other.energy;
    }
    hessian_ = sum.equations.hessian();
    gradient_ = sum.equations.gradient();
    if (rows) data_information_ = hessian_, data_gradient_ = gradient_;
    double energy = sum.energy;
    report.evidence = sum.energy;
    add_priors(problem, pose, shape, hessian_, gradient_, energy);
    report.data = sum.data / std::max(sum.data_count, 1.0);
    report.unexplained = sum.unexplained / std::max(sum.data_count, 1.0);
    report.free_space = sum.violations / std::max(sum.tested, 1.0);
    return energy;
  };

  bool standing = false;  // the poser and the grid are at (q, beta)
  for (const RefineSchedule::Stage& stage : schedule.stages) {
    problem.stage = stage;
    double damping = kFirstDamping;
    if (!standing) pose_at(q, beta);
    double energy = evaluate_here(q, beta, true);
    standing = true;
    information_ = hessian_;
    step_ = gradient_;
    UnknownVector gradient = gradient_;
    bool converged = false;
    const bool last_stage = &stage == &schedule.stages.back();
    for (int iteration = 0; iteration < stage.iterations && !converged; ++iteration) {
      damped_ = information_;
      for (int i = 0; i < unknowns; ++i) damped_(i, i) += damping * information_(i, i) + 1e-6;
      step_ = damped_.ldlt().solve(gradient);
      step_ *= -step_fraction(step_);
      if (schedule.least_promise > 0 && -2 * gradient.dot(step_) - step_.dot(information_ * step_) < schedule.least_promise * energy) break;
      const PoseVector trial_q = q + step_.head<kDofs>();
      ShapeVector trial_beta = beta;
      if (schedule.shape) trial_beta += step_.tail(shape_count());
      pose_at(trial_q, trial_beta);
      // Of the last step only the figures are wanted: the curvature hardly changes any more.
      const bool rows = schedule.shape || !last_stage || iteration + 1 < stage.iterations;
      const double trial = evaluate_here(trial_q, trial_beta, rows);
      standing = trial <= energy;
      ++report.iterations;
      if (standing) {
        converged = step_.cwiseAbs().maxCoeff() < kConverged || energy - trial < kNoGain * energy;
        q = trial_q, beta = trial_beta, energy = trial;
        if (rows) information_ = hessian_, gradient = gradient_;
        damping = std::max(damping * 0.3, 1e-6);
      } else {
        converged = step_.cwiseAbs().maxCoeff() < kConverged || damping >= kMostDamping;
        damping *= 8;
      }
    }
    report.energy = energy;
  }
  if (!standing) {  // leave the poser, the grid and the figures at the solution
    pose_at(q, beta);
    evaluate_here(q, beta, schedule.shape);
    if (schedule.shape) information_ = hessian_;
  }
  return report;
}

}  // namespace booth::fit

// Search, refinement in widening detail, motion model, and an information filter over the shape.
#include "fit/track/booth_fitter.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace booth::fit {
namespace {

constexpr int kShapeCount = 24;  // coefficients that preset booth follows
constexpr int kBatch = 14;       // candidates that get a first refinement together
constexpr int kBatches = 3;      // of them at most: the next is tried only when the best so far does not convince
constexpr double kConvincingData = 0.07, kConvincingFreeSpace = 0.03;
constexpr double kLimbGain = 0.98;      // share of the evidence's energy that a replaced limb may leave
constexpr double kFreshGain = 0.8;      // and a fresh start
constexpr double kPatience = 0.5;       // seconds of doubt before a fresh start is tried, and between two of them
constexpr double kLearnableData = 0.3;  // the shape is not learnt from frames that are explained worse
constexpr int kFewestPoints = 200;      // fewer are no person
constexpr double kLostData = 0.55;      // robust residual above which the model does not explain the cloud
constexpr double kLostFreeSpace = 0.45;
constexpr double kVelocityMemory = 0.4;    // share of the old velocity in the new
constexpr double kPredictionShare = 0.8;   // of the velocity that is trusted for one frame
constexpr double kShapeFrameTrust = 0.25;  // frames 1/30 s apart are not independent looks at the body
constexpr double kNoShapePrior = 1e-3;     // what is left of it where a study takes it away: the problem stays solvable
constexpr double kMostShapeFrames = 60;    // the belief never weighs more than so many frames: it stays correctable

}  // namespace

BoothFitter::BoothFitter(const BodyModel& model, const PosePrior& prior, WorkerPool& pool, const FitParts& parts)
    : model_(model),
      prior_(prior),
      parts_(parts),
      search_(model, prior, pool),
      coarse_(model, prior, {.shape_count = 10, .vertices = 1500, .model_samples = 300}, pool),
      fine_(model, prior, {.shape_count = kShapeCount, .vertices = model.vertex_count(), .model_samples = 700}, pool) {
  coarse_schedule_ = {.cloud_samples = 500, .model_samples = 200, .shape = false, .stages = {{8, 0.15f, 0.35f}}};
  middle_schedule_ = {.cloud_samples = 800, .model_samples = 300, .shape = true, .stages = {{12, 0.08f, 0.20f}}};
  limb_schedule_ = {.cloud_samples = 600, .model_samples = 200, .shape = false, .stages = {{4, 0.10f, 0.25f}, {3, 0.04f, 0.12f}}};
  start_schedule_ = {.cloud_samples = 2000, .model_samples = 700, .shape = true, .stages = {{10, 0.05f, 0.15f}, {10, 0.025f, 0.10f}}};
  thorough_track_schedule_ = {.cloud_samples = 1500, .model_samples = 500, .shape = true, .stages = {{3, 0.05f, 0.15f}, {5, 0.025f, 0.10f}}};
  // Near the solution one robust scale and half the steps come to the same place: see docs/design/performance-pipeline.md.
  track_schedule_ = {.cloud_samples = 1500, .model_samples = 500, .shape = false, .stages = {{5, 0.03f, 0.12f}}};
  if (!parts_.pose_prior) weights_.pose_outside = weights_.pose_inside = weights_.limits = 0;
  if (!parts_.symmetry) weights_.bone = 0;
  if (!parts_.two_sided) weights_.effective_points = weights_.free_space = 0;
  fine_weights_ = weights_;
  if (!parts_.refinement)
    for (RefineSchedule* s : {&coarse_schedule_, &middle_schedule_, &start_schedule_, &limb_schedule_, &thorough_track_schedule_, &track_schedule_})
      for (auto& stage : s->stages) stage.iterations = 0;
  const auto identity = [](int n) {
    ShapeBelief b;
    b.mean = ShapeVector::Zero(n);
    b.information = UnknownMatrix::Identity(n, n);
    return b;
  };
  no_belief_ = identity(coarse_.shape_count());
  if (!parts_.shape_prior) no_belief_.information *= kNoShapePrior;
  belief_ = identity(fine_.shape_count());
  vertex_velocity_ = Vertices::Zero(3, fine_.poser().size());
  candidates_.reserve(kBatches * kBatch);
  solutions_.resize(kBatch);
  reset();
}

void BoothFitter::reset() {
  lose();
  belief_.mean.setZero(fine_.shape_count());
  belief_.information.setIdentity(fine_.shape_count(), fine_.shape_count());
  if (!parts_.shape_prior) belief_.information *= kNoShapePrior;
  beta_ = belief_.mean;
  if (shape_frames_ > 0) search_.set_shape(beta_);
  shape_frames_ = 0;
}

void BoothFitter::lose() {
  velocity_.setZero();
  tracked_frames_ = 0;
}

void BoothFitter::remember(const Learnt& learnt) {
  belief_ = learnt.belief;
  beta_ = learnt.beta;
  shape_frames_ = learnt.frames;
}

bool BoothFitter::convincing(const RefineReport& report) { return report.data < kConvincingData && report.free_space < kConvincingFreeSpace; }

bool BoothFitter::accepted(const RefineReport& report, const Observation& observation) const {
  return observation.cloud.size >= kFewestPoints && report.data < kLostData && report.free_space < kLostFreeSpace;
}

void BoothFitter::refine_fine(const Observation& observation, const RefineSchedule& schedule, const PoseBelief& belief, const Vertices* velocity,
                              Solution& solution) {
  solution.report = fine_.refine(observation, fine_weights_, schedule, belief, belief_, velocity, solution.q, solution.beta);
  solution.iterations += solution.report.iterations;
  solution.found = accepted(solution.report, observation);
}

void BoothFitter::prepare_schedules(const Observation& observation) {
  // Without images only the cloud itself can say where the model does not belong.
  for (RefineSchedule* s : {&coarse_schedule_, &middle_schedule_, &start_schedule_}) s->model_to_cloud = observation.views.empty() || !parts_.two_sided;
  middle_schedule_.shape = shape_frames_ == 0;
}

Solution BoothFitter::start(const Observation& observation) {
  finalist_count_ = 0;
  if (observation.cloud.size < kFewestPoints) return start_from(observation, {});
  prepare_schedules(observation);
  if (shape_frames_ > 0) search_.set_shape(beta_);
  search_.search(observation, kBatches * kBatch, candidates_);

  Solution best;
  std::array<PoseVector, kFinalists> best_finalists;
  int best_count = 0, iterations = 0;
  bool last_is_best = true;
  for (std::size_t first = 0; first < candidates_.size(); first += kBatch) {
    auto end = solutions_.begin();
    for (std::size_t c = first; c < std::min(first + kBatch, candidates_.size()); ++c) {
      Solution& s = *end++;
      s.q = candidates_[c].q;
      s.beta = beta_.head(coarse_.shape_count());
      s.report = coarse_.refine(observation, weights_, coarse_schedule_, {}, no_belief_, nullptr, s.q, s.beta);
      iterations += s.report.iterations;
    }
    std::sort(solutions_.begin(), end, [](const Solution& a, const Solution& b) { return a.report.energy < b.report.energy; });
    std::array<PoseVector, kFinalists> poses;
    const auto count = std::min<std::size_t>(kFinalists, static_cast<std::size_t>(end - solutions_.begin()));
    for (std::size_t i = 0; i < count; ++i) poses[i] = solutions_[i].q;
    const Solution s = start_from(observation, {poses.data(), count});
    iterations += s.iterations;
    last_is_best = first == 0 || s.report.energy < best.report.energy;
    if (last_is_best) best = s, best_finalists = finalists_, best_count = finalist_count_;
    if (convincing(best.report)) break;
    if (!last_is_best) continue;
    // Often it is one limb that ended in the wrong place: cheaper to try than another batch.
    const RefineReport before = best.report;
    last_is_best = find_lost_limbs(observation, start_schedule_, nullptr, best);
    if (best.report.evidence < before.evidence) best_finalists[0] = best.q;
    if (convincing(best.report)) break;
  }
  finalists_ = best_finalists;
  finalist_count_ = best_count;
  if (!last_is_best) refine_fine(observation, start_schedule_, {}, nullptr, best);  // the refiner has to stand at the solution
  best.iterations = iterations;
  return best;
}

Solution BoothFitter::start_from(const Observation& observation, std::span<const PoseVector> poses) {
  Solution best;
  best.beta = beta_;
  finalist_count_ = 0;
  if (poses.empty() || observation.cloud.size < kFewestPoints) return best;
  prepare_schedules(observation);
  auto end = solutions_.begin();
  for (const PoseVector& q : poses.first(std::min<std::size_t>(poses.size(), kFinalists))) {
    Solution& s = *end++;
    s.q = q;
    s.beta = beta_.head(coarse_.shape_count());
    s.report = coarse_.refine(observation, weights_, middle_schedule_, {}, no_belief_, nullptr, s.q, s.beta);
    best.iterations += s.report.iterations;
  }
  std::sort(solutions_.begin(), end, [](const Solution& a, const Solution& b) { return a.report.energy < b.report.energy; });
  for (auto s = solutions_.begin(); s != end; ++s) finalists_[static_cast<std::size_t>(finalist_count_++)] = s->q;
  best.q = solutions_.front().q;
  best.beta.head(coarse_.shape_count()) = solutions_.front().beta;
  refine_fine(observation, start_schedule_, {}, nullptr, best);
  return best;
}

void BoothFitter::adopt(const Observation& observation, const Solution& solution) {
  q_ = solution.q;
  velocity_.setZero();
  time_ = doubtful_since_ = observation.time;
  tracked_frames_ = 0;
  learn_shape(solution);
}

void BoothFitter::learn_shape(const Solution& solution) {
  if (solution.report.data > kLearnableData) return;
  beta_ = solution.beta;
  belief_.mean = solution.beta;
  const int n = fine_.shape_count();
  const UnknownMatrix& h = fine_.data_information();
  if (h.rows() != kDofs + n) return;  // the shape was held
  // What this frame alone says of the shape when the pose may be anything: the Schur complement of the pose block.
  UnknownMatrix pose = h.topLeftCorner(kDofs, kDofs);
  pose.diagonal().array() += 1;
  const UnknownMatrix coupling = h.topRightCorner(kDofs, n);
  UnknownMatrix seen = h.bottomRightCorner(n, n);
  seen.noalias() -= coupling.transpose() * pose.ldlt().solve(coupling);
  // Exponential forgetting keeps the weight bounded; the population prior never fades.
  const double keep = 1 - 1 / kMostShapeFrames;
  UnknownMatrix learnt = belief_.information;
  learnt.diagonal().array() -= 1;
  learnt = keep * learnt + kShapeFrameTrust * seen;
  learnt.diagonal().array() += 1;
  belief_.information = 0.5 * (learnt + learnt.transpose());
  ++shape_frames_;
}

bool BoothFitter::find_lost_limbs(const Observation& observation, const RefineSchedule& schedule, const Vertices* velocity, Solution& solution) {
  std::array<PoseVector, StartSearch::kLimbs * StartSearch::kPerLimb> poses;
  const int count = search_.propose_limbs(observation, solution.beta, solution.q, poses);
  if (count == 0) return true;
  // Each against the pose as it is, on equal terms: a short coarse refinement of both.
  limb_schedule_.model_to_cloud = observation.views.empty() || !parts_.two_sided;
  const auto try_out = [&](PoseVector q) {
    ShapeVector beta = solution.beta.head(coarse_.shape_count());
    const RefineReport report = coarse_.refine(observation, weights_, limb_schedule_, {}, no_belief_, nullptr, q, beta);
    return std::pair{report.evidence, q};
  };
  auto [best, best_q] = try_out(solution.q);
  const double as_it_is = best;
  for (const PoseVector& pose : std::span(poses).first(static_cast<std::size_t>(count))) {
    const auto [evidence, q] = try_out(pose);
    if (evidence < best) best = evidence, best_q = q;
  }
  if (best > kLimbGain * as_it_is) return true;
  Solution other = solution;
  other.q = best_q;
  refine_fine(observation, schedule, {best_q, PoseVector::Zero()}, velocity, other);
  if (other.report.evidence >= kLimbGain * solution.report.evidence) return false;
  solution = other;
  return true;
}

bool BoothFitter::start_afresh(const Observation& observation, Solution& solution) {
  // The body may be what is wrong: try without what was learnt.
  const Learnt kept = learnt();
  const PoseVector kept_velocity = velocity_;
  const int kept_tracked = tracked_frames_;
  reset();
  const Solution fresh = start(observation);
  if (fresh.found && fresh.report.evidence < kFreshGain * solution.report.evidence) {
    solution = fresh;
    adopt(observation, fresh);
    return true;
  }
  remember(kept);
  velocity_ = kept_velocity;
  tracked_frames_ = kept_tracked;
  return false;
}

Solution BoothFitter::track(const Observation& observation) {
  const double dt = std::clamp(observation.time - time_, 1e-3, 0.2);
  Solution s;
  s.q = q_ + kPredictionShare * dt * velocity_;
  s.beta = beta_;
  if (observation.cloud.size < kFewestPoints) return s;

  PoseBelief belief;
  belief.mean = s.q;
  // A frame's change of speed rarely exceeds what the joint can do in one frame.
  belief.inverse_variance = (prior_.speed_limit * dt).array().square().inverse();

  // Velocity of each vertex, so that a camera's points are compared with the body at that camera's own time.
  const bool moving = tracked_frames_ > 0 && !observation.views.empty();
  if (moving) {
    const Poser& poser = fine_.poser();
    fine_.place(s.q, beta_);
    for (int i = 0; i < poser.size(); ++i) vertex_velocity_.col(i) = poser.position(i);
    fine_.place(s.q - dt * velocity_, beta_);
    for (int i = 0; i < poser.size(); ++i) vertex_velocity_.col(i) = (vertex_velocity_.col(i) - poser.position(i)) / static_cast<float>(dt);
  }

  const bool learn = !shape_settled() || tracked_frames_ % 10 == 0;
  const Vertices* velocity = moving ? &vertex_velocity_ : nullptr;
  RefineSchedule& schedule = thorough_track_schedule_;
  schedule.shape = track_schedule_.shape = learn;
  schedule.model_to_cloud = track_schedule_.model_to_cloud = observation.views.empty() || !parts_.two_sided;
  const bool quick = shape_settled() && tracked_frames_ > 0;
  refine_fine(observation, quick ? track_schedule_ : schedule, belief, velocity, s);
  if (quick && !convincing(s.report)) refine_fine(observation, schedule, belief, velocity, s);  // where the prediction was far off
  if (convincing(s.report)) {
    doubtful_since_ = observation.time;
  } else {
    if (!find_lost_limbs(observation, schedule, velocity, s)) refine_fine(observation, schedule, belief, velocity, s);
    if (observation.time - doubtful_since_ > kPatience) {
      doubtful_since_ = observation.time;
      if (start_afresh(observation, s)) return s;
      refine_fine(observation, schedule, belief, velocity, s);  // the refiner has to stand at the solution again
    }
  }
  if (!s.found) return s;

  const PoseVector speed = (s.q - q_) / dt;
  velocity_ = tracked_frames_ == 0 ? PoseVector(0.5 * speed) : PoseVector(kVelocityMemory * velocity_ + (1 - kVelocityMemory) * speed);
  velocity_ = velocity_.cwiseMax(-prior_.speed_limit).cwiseMin(prior_.speed_limit);  // a limb that was found again did not fly there
  q_ = s.q;
  time_ = observation.time;
  ++tracked_frames_;
  if (learn) learn_shape(s);
  return s;
}

}  // namespace booth::fit

// Search, refinement in widening detail, motion model, and an information filter over the shape.
#include "fit/track/booth_fitter.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace booth::fit {
namespace {

constexpr int kShapeCount = 24;  // coefficients that preset booth follows
constexpr int kEntrants = 36;    // candidates that enter a race of refinements: the best go on to the next, finer round
constexpr int kHeats = 2;        // races at most: the second is run only when the winner of the first does not convince
constexpr int kSecondRound = 12;
constexpr double kConvincingData = 0.07, kConvincingFreeSpace = 0.03;
constexpr double kSureData = 0.034, kSureUnexplained = 0.005, kSureFreeSpace = 0.025;  // the winner of a race that leaves more may have a limb wrong
constexpr double kDoubtfulData = 0.042;                                                // and so may a finished start
constexpr double kStartPromise = 2e-4;                                                 // of the energy, that a step of a start must promise
constexpr double kSameMove = 0.06, kSameTurn = 0.15;                                   // m, rad: poses nearer than this are one finalist
constexpr double kLimbGain = 0.98;                                                     // share of the evidence's energy that a replaced limb may leave
constexpr double kFoundGain = 0.9;                                                     // the same where only one frame after another says that a limb is lost
constexpr double kUsualAtFirst = 0.02;                                                 // what a frame leaves of an undressed person
constexpr double kUneasy = 1.5;                                                        // times the usual is more than chance leaves
constexpr double kUsualFalls = 0.1, kUsualRises = 0.01;    // share of a frame in the usual: what stays for seconds is how a person looks
constexpr double kUneasyTime = 0.08, kLookAgain = 0.15;    // seconds of it before limbs are looked for, and until they are again
constexpr int kLimbFinalists = 5;                          // of the proposed limbs, how many get a second look
constexpr int kLimbRounds = 2;                             // limbs of a start that may be replaced one after another
constexpr double kFreshGain = 0.8;                         // and a fresh start
constexpr double kPatience = 0.5;                          // seconds of doubt before a fresh start is tried;
constexpr double kMostPatience = 8;                        // each that does not help doubles them, up to this, until the body
constexpr double kMuchWorse = 1.5;                         // leaves so many times what it left then
constexpr double kUndressTurn = 0.1, kUndressMove = 0.03;  // rad, m; how far the pose may lie from that of the clothes
constexpr int kUnseenRounds = 3;                           // in which limbs are left out or taken in again
constexpr double kHalfUnexplained = 0.04;                  // share of the points that a finished start leaves, above which the cloud may be half a person
constexpr double kTopGain = 0.8;                           // share of the cloud's residual that half a person may leave, to be taken
constexpr BoneSet kLegs = 0b11110111100;                   // thigh, shank, foot and toes of either side
constexpr double kUnseenLoss = 1.03;                       // share of the cloud's residual that leaving a limb out may leave; more says that it was seen
constexpr double kUnseenLossUsual = 1.06;                  // where the pose without it is so much more usual that the energy falls
constexpr double kClearData = 0.1;                         // with others about, the shape is learnt after a frame that was explained so well
constexpr double kLearnableData = 0.3;                     // the shape is not learnt from frames that are explained worse
constexpr int kFewestPoints = 200;                         // fewer are no person
constexpr double kLostData = 0.55;                         // robust residual above which the model does not explain the cloud
constexpr double kLostFreeSpace = 0.45;
// A start with a body as one in twenty is, which stands where cameras saw through, found none: an adult folded into a child, say. Standard deviations.
constexpr double kStrangeShape = 3, kStrangeFreeSpace = 0.05;
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
      rough_(model, prior, {.shape_count = 1, .vertices = 700, .model_samples = 120}, pool),
      coarse_(model, prior, {.shape_count = 10, .vertices = 1500, .model_samples = 300}, pool),
      fine_(model, prior, {.shape_count = kShapeCount, .vertices = model.vertex_count(), .model_samples = 700}, pool),
      support_(fine_.poser().size()) {
  rough_schedule_ = {.cloud_samples = 300, .model_samples = 120, .shape = false, .stages = {{3, 0.15f, 0.35f}}};
  coarse_schedule_ = {.cloud_samples = 500, .model_samples = 200, .shape = false, .stages = {{5, 0.15f, 0.35f}}};
  middle_schedule_ = {.cloud_samples = 800, .model_samples = 300, .shape = true, .stages = {{6, 0.08f, 0.20f}, {5, 0.04f, 0.12f}}};
  limb_glance_schedule_ = {.cloud_samples = 400, .model_samples = 150, .shape = false, .stages = {{3, 0.10f, 0.25f}}};
  limb_schedule_ = {.cloud_samples = 600, .model_samples = 200, .shape = false, .stages = {{4, 0.10f, 0.25f}, {3, 0.04f, 0.12f}}};
  start_schedule_ = {.cloud_samples = 2000, .model_samples = 700, .shape = true, .stages = {{10, 0.05f, 0.15f}, {10, 0.025f, 0.10f}}};
  thorough_track_schedule_ = {.cloud_samples = 1500, .model_samples = 500, .shape = true, .stages = {{3, 0.05f, 0.15f}, {5, 0.025f, 0.10f}}};
  // Near the solution one robust scale and half the steps come to the same place: see docs/design/performance-pipeline.md.
  track_schedule_ = {.cloud_samples = 1500, .model_samples = 500, .shape = false, .stages = {{5, 0.03f, 0.12f}}};
  for (RefineSchedule* s : {&rough_schedule_, &coarse_schedule_, &middle_schedule_, &start_schedule_, &limb_glance_schedule_, &limb_schedule_})
    s->least_promise = kStartPromise;
  if (!parts_.pose_prior) weights_.pose_outside = weights_.pose_inside = weights_.limits = 0;
  if (!parts_.symmetry) weights_.bone = 0;
  if (!parts_.two_sided) weights_.effective_points = weights_.free_space = 0;
  fine_weights_ = weights_;
  if (!parts_.refinement)
    for (RefineSchedule* s : {&rough_schedule_, &coarse_schedule_, &middle_schedule_, &start_schedule_, &limb_glance_schedule_, &limb_schedule_,
                              &thorough_track_schedule_, &track_schedule_})
      for (auto& stage : s->stages) stage.iterations = 0;
  const auto identity = [](int n) {
    ShapeBelief b;
    b.mean = ShapeVector::Zero(n);
    b.information = UnknownMatrix::Identity(n, n);
    return b;
  };
  no_belief_ = identity(coarse_.shape_count());
  rough_belief_ = identity(rough_.shape_count());
  if (!parts_.shape_prior) no_belief_.information *= kNoShapePrior;
  belief_ = identity(fine_.shape_count());
  vertex_velocity_ = Vertices::Zero(3, fine_.poser().size());
  candidates_.reserve(StartSearch::kMostCandidates);
  solutions_.resize(kEntrants);
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

std::size_t BoothFitter::memory_bytes() const {
  return sizeof(*this) - sizeof(search_) - sizeof(rough_) - sizeof(coarse_) - sizeof(fine_) - sizeof(support_) + support_.memory_bytes() +
         search_.memory_bytes() + rough_.memory_bytes() + coarse_.memory_bytes() + fine_.memory_bytes() +
         static_cast<std::size_t>(vertex_velocity_.size()) * sizeof(float) + candidates_.capacity() * sizeof(StartCandidate) +
         solutions_.capacity() * sizeof(Solution);
}

bool BoothFitter::sure(const RefineReport& report) {
  return report.data < kSureData && report.unexplained < kSureUnexplained && report.free_space < kSureFreeSpace;
}

bool BoothFitter::accepted(const RefineReport& report, const Observation& observation) {
  return observation.cloud.size >= kFewestPoints && report.data < kLostData && report.free_space < kLostFreeSpace;
}

void BoothFitter::refuse_strange(Solution& solution) {
  if (solution.report.free_space > kStrangeFreeSpace && solution.beta.cwiseAbs().maxCoeff() > kStrangeShape) solution.found = false;
}

void BoothFitter::refine_fine(const Observation& observation, const RefineSchedule& schedule, const PoseBelief& belief, const Vertices* velocity,
                              Solution& solution) {
  fine_weights_.unseen = solution.unseen;
  solution.report = fine_.refine(observation, fine_weights_, schedule, belief, belief_, velocity, solution.q, solution.beta);
  solution.iterations += solution.report.iterations;
  solution.found = accepted(solution.report, observation);
}

void BoothFitter::prepare_schedules(const Observation& observation) {
  // Without images only the cloud itself can say where the model does not belong.
  for (RefineSchedule* s : {&rough_schedule_, &coarse_schedule_, &middle_schedule_, &start_schedule_})
    s->model_to_cloud = observation.views.empty() || !parts_.two_sided;
  middle_schedule_.shape = shape_frames_ == 0;
}

void BoothFitter::refine_all(Refiner& refiner, const RefineSchedule& schedule, const ShapeBelief& belief, const Observation& observation,
                             std::span<Solution> all) {
  for (Solution& s : all) {
    s.beta = beta_.head(refiner.shape_count());
    s.report = refiner.refine(observation, weights_, schedule, {}, belief, nullptr, s.q, s.beta);
    s.iterations += s.report.iterations;
  }
  std::sort(all.begin(), all.end(), [](const Solution& a, const Solution& b) { return a.report.energy < b.report.energy; });
}

std::size_t BoothFitter::keep_different(std::span<Solution> sorted, std::size_t most) {
  std::size_t kept = 0;
  for (Solution& s : sorted) {
    if (kept == most) break;
    const bool is_new = std::none_of(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(kept), [&](const Solution& other) {
      const PoseVector d = (s.q - other.q).cwiseAbs();
      return d.head<3>().maxCoeff() < kSameMove && d.tail<kDofs - 3>().maxCoeff() < kSameTurn;
    });
    if (is_new) std::swap(sorted[kept++], s);
  }
  return kept;
}

Solution BoothFitter::race(const Observation& observation, std::span<const StartCandidate> entrants) {
  const std::span<Solution> all = std::span(solutions_).first(std::min(entrants.size(), solutions_.size()));
  for (std::size_t i = 0; i < all.size(); ++i) all[i].q = entrants[i].q, all[i].iterations = 0;
  refine_all(rough_, rough_schedule_, rough_belief_, observation, all);
  const std::span<Solution> second = all.first(keep_different(all, kSecondRound));
  refine_all(coarse_, coarse_schedule_, no_belief_, observation, second);
  const std::span<Solution> last = second.first(keep_different(second, kFinalists));
  refine_all(coarse_, middle_schedule_, no_belief_, observation, last);
  Solution best = last.front();
  best.iterations = 0;
  for (const Solution& s : all) best.iterations += s.iterations;
  return best;
}

Solution BoothFitter::start(const Observation& observation, BoothFitter* other_model, int heats) {
  fine_weights_.outside = 1;
  if (observation.cloud.size < kFewestPoints) return start_from(observation, {});
  prepare_schedules(observation);
  if (shape_frames_ > 0) search_.set_shape(beta_);
  heats = std::clamp(heats, 1, kHeats);
  search_.search(observation, heats * kEntrants, candidates_);

  std::array<Solution, kHeats> winners;
  int count = 0, iterations = 0;
  for (int heat = 0; heat < kHeats; ++heat) {
    const std::size_t first = static_cast<std::size_t>(heat) * kEntrants;
    if (first >= candidates_.size()) break;
    Solution& winner = winners[static_cast<std::size_t>(count++)];
    winner = race(observation, std::span(candidates_).subspan(first, std::min<std::size_t>(kEntrants, candidates_.size() - first)));
    BoothFitter* better = this;
    if (!sure(winner.report) && other_model) {
      Solution other = winner;
      other_model->prepare_schedules(observation);
      other_model->refine_all(other_model->coarse_, other_model->middle_schedule_, other_model->no_belief_, observation, {&other, 1});
      winner.iterations = other.iterations;
      if (other.report.energy < winner.report.energy) winner = other, better = other_model;
    }
    // Often it is one limb that ended in the wrong place: cheaper to try than another race.
    for (int k = 0; k < (heat == 0 ? kLimbRounds : 1) && !sure(winner.report) && better->replace_limb(observation, winner); ++k) continue;
    iterations += winner.iterations;
    if (better != this) winner.beta.setZero();
    if (sure(winner.report)) {
      std::swap(winner, winners.front());
      count = 1;
      break;
    }
  }
  static_assert(kHeats == 2);
  if (count == 2 && winners[1].report.energy < winners[0].report.energy) std::swap(winners[0], winners[1]);
  finalist_count_ = count;
  for (int i = 0; i < count; ++i) finalists_[static_cast<std::size_t>(i)] = winners[static_cast<std::size_t>(i)].q;
  Solution best;
  best.q = winners.front().q;
  best.beta = beta_;
  if (!winners.front().beta.isZero()) best.beta.head(coarse_.shape_count()) = winners.front().beta;
  best.iterations = iterations;
  refine_fine(observation, start_schedule_, {}, nullptr, best);
  if (count == 1 && best.report.data > kDoubtfulData && !find_lost_limbs(observation, start_schedule_, nullptr, true, kLimbGain, best))
    refine_fine(observation, start_schedule_, {}, nullptr, best);  // the refiner has to stand at the solution
  leave_out_unseen(observation, start_schedule_, best);
  if (best.report.unexplained > kHalfUnexplained || (best.unseen & kLegs) != 0) start_from_top(observation, best);
  undress(observation, best);
  refuse_strange(best);
  return best;
}

void BoothFitter::start_from_top(const Observation& observation, Solution& solution) {
  if (!observation.views.empty() || !parts_.two_sided || !parts_.refinement) return;
  search_.search(observation, kEntrants, candidates_, true);
  if (candidates_.empty()) return;
  weights_.unseen = kLegs;
  Solution other = race(observation, candidates_);
  weights_.unseen = 0;
  const PoseVector finalist = other.q;
  ShapeVector beta = beta_;
  beta.head(coarse_.shape_count()) = other.beta;
  other.beta = beta;
  other.unseen = kLegs;
  other.iterations += solution.iterations;
  refine_fine(observation, start_schedule_, {}, nullptr, other);
  leave_out_unseen(observation, start_schedule_, other);
  const double loss = other.report.data / solution.report.data;
  if (loss < kTopGain || (loss <= kUnseenLoss && other.report.energy < solution.report.energy)) {
    solution = other;
    finalists_[0] = finalist;
    finalist_count_ = 1;
  } else {
    refine_fine(observation, start_schedule_, {}, nullptr, solution);  // the refiner has to stand at the solution
  }
}

Solution BoothFitter::start_from(const Observation& observation, std::span<const PoseVector> poses) {
  fine_weights_.outside = 1;
  Solution best;
  best.beta = beta_;
  finalist_count_ = 0;
  if (poses.empty() || observation.cloud.size < kFewestPoints) return best;
  prepare_schedules(observation);
  const std::span<Solution> all = std::span(solutions_).first(std::min<std::size_t>(poses.size(), kFinalists));
  for (std::size_t i = 0; i < all.size(); ++i) all[i].q = poses[i], all[i].iterations = 0;
  refine_all(coarse_, middle_schedule_, no_belief_, observation, all);
  for (const Solution& s : all) {
    finalists_[static_cast<std::size_t>(finalist_count_++)] = s.q;
    best.iterations += s.iterations;
  }
  best.q = solutions_.front().q;
  best.beta.head(coarse_.shape_count()) = solutions_.front().beta;
  refine_fine(observation, start_schedule_, {}, nullptr, best);
  leave_out_unseen(observation, start_schedule_, best);
  undress(observation, best);
  refuse_strange(best);
  return best;
}

void BoothFitter::undress(const Observation& observation, Solution& solution) {
  if (clothed_ == 1) return;
  fine_weights_.outside = clothed_;
  PoseBelief belief{solution.q, PoseVector::Constant(1 / (kUndressTurn * kUndressTurn))};
  belief.inverse_variance.head<3>().setConstant(1 / (kUndressMove * kUndressMove));
  refine_fine(observation, start_schedule_, belief, nullptr, solution);
  fine_weights_.outside = 1;
}

void BoothFitter::adopt(const Observation& observation, const Solution& solution) {
  q_ = solution.q;
  unseen_ = solution.unseen;
  velocity_.setZero();
  time_ = doubtful_since_ = easy_at_ = next_look_ = observation.time;
  usual_ = kUsualAtFirst;
  patience_ = kPatience;
  fruitless_ = 1;  // nothing is worse
  clear_ = false;
  tracked_frames_ = 0;
  learn_shape(solution);
}

void BoothFitter::learn_shape(const Solution& solution) {
  if (solution.report.data > kLearnableData) return;
  const int n = fine_.shape_count();
  const UnknownMatrix& h = fine_.data_information();
  if (h.rows() != kDofs + n) {  // the shape was held
    beta_ = belief_.mean = solution.beta;
    return;
  }
  // What this frame alone says of the shape when the pose may be anything: the Schur complement of the pose block, and where its own minimum would lie.
  UnknownMatrix pose = h.topLeftCorner(kDofs, kDofs);
  pose.diagonal().array() += 1;
  const UnknownMatrix coupling = h.topRightCorner(kDofs, n);
  const auto solver = pose.ldlt();
  UnknownMatrix seen = h.bottomRightCorner(n, n);
  seen.noalias() -= coupling.transpose() * solver.solve(coupling);
  const UnknownVector& g = fine_.data_gradient();
  const UnknownVector of_pose = solver.solve(g.head(kDofs));
  const UnknownVector says = seen * solution.beta - g.tail(n) + coupling.transpose() * of_pose;
  // Exponential forgetting keeps the weight bounded. The population's spread about its mean never fades and is never counted as learnt: where nothing is
  // seen it holds the body for as long as the person is followed.
  const double keep = 1 - 1 / kMostShapeFrames, population = parts_.shape_prior ? 1 : kNoShapePrior;
  const UnknownVector target = keep * (belief_.information * belief_.mean) + kShapeFrameTrust * says;
  UnknownMatrix learnt = belief_.information;
  learnt.diagonal().array() -= population;
  learnt = keep * learnt + kShapeFrameTrust * seen;
  learnt.diagonal().array() += population;
  belief_.information = 0.5 * (learnt + learnt.transpose());
  belief_.mean = belief_.information.ldlt().solve(target);
  beta_ = belief_.mean;
  ++shape_frames_;
}

bool BoothFitter::better_limb(const Observation& observation, const ShapeVector& beta, bool forearms, PoseVector& q, int& iterations) {
  std::array<PoseVector, StartSearch::kLimbs * StartSearch::kPerLimb> poses;
  const int count = search_.propose_limbs(observation, beta, q, forearms, poses);
  if (count == 0) return false;
  // Each against the pose as it is, on equal terms: a short coarse refinement of both, a longer one of those that it leaves ahead.
  limb_schedule_.model_to_cloud = limb_glance_schedule_.model_to_cloud = observation.views.empty() || !parts_.two_sided;
  const auto try_out = [&](const RefineSchedule& schedule, PoseVector& pose) {
    ShapeVector shape = beta.head(coarse_.shape_count());
    const RefineReport report = coarse_.refine(observation, weights_, schedule, {}, no_belief_, nullptr, pose, shape);
    iterations += report.iterations;
    return report.evidence;
  };
  std::array<std::pair<double, int>, StartSearch::kLimbs * StartSearch::kPerLimb> order;
  for (int k = 0; k < count; ++k) order[static_cast<std::size_t>(k)] = {try_out(limb_glance_schedule_, poses[static_cast<std::size_t>(k)]), k};
  std::sort(order.begin(), order.begin() + count);
  PoseVector as_it_is = q;
  double least = kLimbGain * try_out(limb_schedule_, as_it_is);
  bool better = false;
  for (int k = 0; k < std::min(count, kLimbFinalists); ++k) {
    PoseVector& pose = poses[static_cast<std::size_t>(order[static_cast<std::size_t>(k)].second)];
    if (const double evidence = try_out(limb_schedule_, pose); evidence < least) least = evidence, q = pose, better = true;
  }
  return better;
}

bool BoothFitter::replace_limb(const Observation& observation, Solution& solution) {
  Solution other = solution;
  if (!better_limb(observation, solution.beta, true, other.q, other.iterations)) return false;
  refine_all(coarse_, middle_schedule_, no_belief_, observation, {&other, 1});
  solution.iterations = other.iterations;
  if (other.report.energy >= solution.report.energy) return false;
  solution = other;
  return true;
}

bool BoothFitter::find_lost_limbs(const Observation& observation, const RefineSchedule& schedule, const Vertices* velocity, bool forearms, double gain,
                                  Solution& solution) {
  Solution other = solution;
  if (!better_limb(observation, solution.beta, forearms, other.q, other.iterations)) return true;
  refine_fine(observation, schedule, {other.q, PoseVector::Zero()}, velocity, other);
  if (other.report.evidence >= gain * solution.report.evidence) return false;
  solution = other;
  return true;
}

bool BoothFitter::uneasy(const RefineReport& report, double time) {
  const bool usual = report.data < kUneasy * usual_;
  usual_ += (report.data < usual_ ? kUsualFalls : kUsualRises) * (report.data - usual_);
  if (usual) easy_at_ = time;
  return time - easy_at_ > kUneasyTime && time > next_look_;
}

void BoothFitter::leave_out_unseen(const Observation& observation, const RefineSchedule& schedule, Solution& solution) {
  if (!observation.views.empty() || !parts_.two_sided || !parts_.refinement) return;
  for (int round = 0; round < kUnseenRounds; ++round) {
    const BoneSet left_first = support_.unseen(fine_.poser(), observation.cloud, false), right_first = support_.unseen(fine_.poser(), observation.cloud, true);
    // A limb that lies folded beside another draws points from it, and has its support by them; so does what is left of one that is folded into the trunk.
    const std::array<BoneSet, 4> sets{left_first, right_first, left_first | unusual_limbs(prior_, weights_.pose_outside, weights_.pose_inside, solution.q),
                                      whole_limbs(left_first)};
    Solution best;
    bool tried = false, accepted = false, at_best = false;
    for (auto set = sets.begin(); set != sets.end(); ++set) {
      if (*set == solution.unseen || std::find(sets.begin(), set, *set) != set) continue;
      Solution other = solution;
      other.unseen = *set;
      complete_pose(prior_, weights_.pose_outside, weights_.pose_inside, other.unseen, other.q);
      refine_fine(observation, schedule, {}, nullptr, other);
      tried = true;
      const double loss = other.report.data / solution.report.data;
      at_best = (loss <= kUnseenLoss || (loss <= kUnseenLossUsual && other.report.energy < solution.report.energy)) &&
                (!accepted || other.report.energy < best.report.energy);
      if (at_best) best = other, accepted = true;
    }
    if (accepted) solution = best;
    if (tried && !at_best) refine_fine(observation, schedule, {}, nullptr, solution);  // the refiner has to stand at the solution
    if (!accepted) return;
  }
}

bool BoothFitter::start_afresh(const Observation& observation, Solution& solution) {
  // The body may be what is wrong: try without what was learnt.
  const Learnt kept = learnt();
  const PoseVector kept_velocity = velocity_;
  const int kept_tracked = tracked_frames_;
  reset();
  const Solution fresh = start(observation, nullptr);
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
  fine_weights_.outside = clothed_;
  const double dt = std::clamp(observation.time - time_, 1e-3, 0.2);
  Solution s;
  s.q = q_ + kPredictionShare * dt * velocity_;
  s.beta = beta_;
  if (observation.views.empty()) s.unseen = unseen_;
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

  // Other people's points would draw limbs to them, and the shape: what is left of a chair would not.
  const bool crowded = observation.crowded;
  const bool learn = (!crowded || clear_) && (!shape_settled() || tracked_frames_ % 10 == 0);
  const Vertices* velocity = moving ? &vertex_velocity_ : nullptr;
  RefineSchedule& schedule = thorough_track_schedule_;
  schedule.shape = track_schedule_.shape = learn;
  schedule.model_to_cloud = track_schedule_.model_to_cloud = observation.views.empty() || !parts_.two_sided;
  const bool quick = shape_settled() && tracked_frames_ > 0;
  refine_fine(observation, quick ? track_schedule_ : schedule, belief, velocity, s);
  if (quick && !convincing(s.report)) refine_fine(observation, schedule, belief, velocity, s);  // where the prediction was far off
  clear_ = s.report.data < kClearData;
  if (crowded) {
    doubtful_since_ = observation.time;  // a fresh start would be one with others, too
  } else if (convincing(s.report)) {
    doubtful_since_ = observation.time;
    patience_ = kPatience;
    if (quick && uneasy(s.report, observation.time)) {
      next_look_ = observation.time + kLookAgain;
      if (!find_lost_limbs(observation, track_schedule_, velocity, true, kFoundGain, s)) refine_fine(observation, track_schedule_, belief, velocity, s);
    }
  } else {
    // Between two frames a forearm does not turn about: what fits better there is seldom true.
    if (!find_lost_limbs(observation, schedule, velocity, velocity == nullptr, kLimbGain, s)) refine_fine(observation, schedule, belief, velocity, s);
    if (s.report.data > kMuchWorse * fruitless_) patience_ = kPatience;
    if (observation.time - doubtful_since_ > patience_) {
      doubtful_since_ = observation.time;
      patience_ = std::min(2 * patience_, kMostPatience);
      if (start_afresh(observation, s)) return s;
      fruitless_ = s.report.data;
      fine_weights_.outside = clothed_;
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

// Chooses between presets and between men and women, decides found, tracked or lost, and fills in the result.
#include "fit/estimator.hpp"

#include <stdexcept>
#include <vector>

#include "fit/energy/terms.hpp"
#include "fit/parallel.hpp"
#include "fit/swarm/backend.hpp"
#include "fit/swarm/device/cuda_device.hpp"
#include "fit/swarm/device/device_swarm.hpp"
#include "fit/swarm/guarded_swarm.hpp"
#include "fit/track/booth_fitter.hpp"
#include "fit/track/diagnostics.hpp"
#include "fit/track/paper_fitter.hpp"
#include "fit/track/rest_filter.hpp"

namespace booth::fit {
namespace {

constexpr int kBadFramesUntilSearch = 2;  // a single bad frame is bridged, not searched
constexpr int kRivalFrames = 10;          // men's and women's models both follow a new person for so long; then the better is kept
constexpr double kStrangerGain = 0.8;     // share of the evidence's energy that a new body may leave, to be taken for somebody else
constexpr double kClothWeight = 0.05;     // of points outside the body where it is clothed: docs/design/detail.md
constexpr double kRivalShare = 1.5;       // a model whose first energy is more than this share above the best is out at once

}  // namespace

struct Estimator::Impl {
  struct Candidate {
    std::shared_ptr<const BodyModel> model;
    std::unique_ptr<BoothFitter> booth;
    std::unique_ptr<PaperFitter> paper;
    std::unique_ptr<Diagnostics> diagnostics;
  };

  EstimatorSettings settings;
  std::shared_ptr<const PosePrior> prior;
  WorkerPool pool;
  std::vector<Candidate> candidates;
  std::unique_ptr<SwarmBackend> swarm;    ///< preset paper: one for all candidates
  const GuardedSwarm* guarded = nullptr;  ///< `swarm`, where it has a device
  DeviceBytes on_device;
  Candidate* person = nullptr;  ///< whose body is known
  struct {
    Candidate* person = nullptr;
    BoothFitter::Learnt body;
  } before;                                    ///< whose settled body a stranger's took the place of, until that has settled, too
  Candidate* rival = nullptr;                  ///< the other sex's model while it has not been decided
  double person_energy = 0, rival_energy = 0;  ///< summed over the frames since both were adopted
  int rival_frames = 0;
  Candidate* last = nullptr;  ///< who made the last result
  bool following = false;
  int bad_frames = 0;
  RestFilter steady;  ///< preset booth, a followed person
  FitResult result;

  Impl(std::shared_ptr<const BodyModel> men, std::shared_ptr<const BodyModel> women, std::shared_ptr<const PosePrior> p, EstimatorSettings s)
      : settings(s), prior(std::move(p)), pool(s.threads) {
    if (!prior) throw std::invalid_argument("estimator: there is no pose prior");
    prior->check();
    for (auto& model : {men, women}) {
      if (!model || (s.sex == SexChoice::men && model->sex() != Sex::men) || (s.sex == SexChoice::women && model->sex() != Sex::women)) continue;
      Candidate c;
      c.model = model;
      if (s.preset == Preset::booth) c.booth = std::make_unique<BoothFitter>(*model, *prior, pool, s.parts);
      if (c.booth && s.clothed) c.booth->set_clothed(kClothWeight);
      c.diagnostics = std::make_unique<Diagnostics>(*model);
      candidates.push_back(std::move(c));
    }
    if (candidates.empty()) throw std::invalid_argument("estimator: no body model for the sex that was asked for");
    if (s.preset == Preset::paper) make_paper_fitters();
    last = &candidates.front();
  }

  void make_paper_fitters() {
    std::vector<const BodyModel*> models;
    for (const Candidate& c : candidates) models.push_back(c.model.get());
    PaperWeights weights;
    if (!settings.parts.pose_prior) weights.pose = 0;
    if (!settings.parts.shape_prior) weights.shape = 0;
    const SwarmSizes sizes{.swarm = settings.swarm,
                           .energy = {.shape_count = PaperFitter::kShapeCount, .vertices = PaperFitter::kVertices, .weights = weights},
                           .field = {.max_points = settings.cloud_capacity}};
    swarm = make_cpu_swarm(models, *prior, sizes, pool);
    if (settings.backend == BackendChoice::cuda || (settings.backend == BackendChoice::automatic && device::cuda_built_in())) {
      SwarmSizes device_sizes = sizes;
      device_sizes.swarm.particles = settings.device_particles;
      on_device = device::plan_device_swarm(models, *prior, device_sizes);
      const DeviceOpen open = settings.open_device ? settings.open_device : device::make_cuda_device;
      auto both = make_guarded_swarm(
          std::move(swarm),
          [models, p = prior, device_sizes, open](std::string& why) -> std::unique_ptr<SwarmBackend> {
            try {
              if (auto found = open(why)) return device::make_device_swarm(std::move(found), models, *p, device_sizes);
            } catch (const std::exception& e) {
              why = e.what();
            }
            return nullptr;
          },
          settings.guard);
      guarded = both.get();
      swarm = std::move(both);
    }
    for (std::size_t i = 0; i < candidates.size(); ++i)
      candidates[i].paper = std::make_unique<PaperFitter>(*candidates[i].model, *prior, *swarm, static_cast<int>(i));
  }

  void reset() {
    for (Candidate& c : candidates) {
      if (c.booth) c.booth->reset();
      if (c.paper) c.paper->reset();
    }
    person = rival = before.person = nullptr;
    following = false;
    bad_frames = 0;
    result = FitResult{};
  }

  /// From nothing, from `initial`, or from where another model's search ended; `known`: with the body that is known.
  Solution solve(Candidate& c, const Observation& observation, const PoseVector* initial, const Candidate* searched = nullptr, bool known = false) {
    if (c.booth) {
      if (initial) return c.booth->start_from(observation, {initial, 1});
      if (searched) return c.booth->start_from(observation, searched->booth->finalists());
      if (known) return c.booth->start(observation, nullptr, 1);
      return c.booth->start(observation, candidates.size() > 1 ? candidates[1].booth.get() : nullptr);
    }
    return c.paper->step(observation, {settings.seed, observation.frame}, initial);
  }

  void adopt(Candidate& c, const Observation& observation, const Solution& s) {
    if (c.booth)
      c.booth->adopt(observation, s);
    else
      c.paper->adopt(s);
  }

  /// Somebody new, from nothing (or `initial`): each model in question is fitted, the better explanation is kept and the other followed for a while.
  Solution meet(const Observation& observation, const PoseVector* initial, Candidate*& chosen) {
    chosen = &candidates.front();
    Solution best = solve(*chosen, observation, initial);
    int iterations = best.iterations;
    rival = nullptr;
    for (std::size_t i = 1; i < candidates.size(); ++i) {
      Solution other = solve(candidates[i], observation, initial, &candidates.front());
      iterations += other.iterations;
      if (other.found && (!best.found || other.report.energy < best.report.energy)) {
        std::swap(best, other);
        chosen = &candidates[i];
        rival = &candidates.front();
      } else {
        rival = &candidates[i];
      }
      if (!other.found || other.report.energy > kRivalShare * best.report.energy) rival = nullptr;
      if (rival) adopt(*rival, observation, other);
    }
    best.iterations = iterations;
    return best;
  }

  /// Somebody who was lost is looked for with the body that is known. Where that does not convince, it may be somebody else: then as if new.
  Solution meet_again(const Observation& observation, const PoseVector* initial, Candidate*& chosen) {
    chosen = person;
    Solution known = solve(*person, observation, initial, nullptr, true);
    rival = nullptr;
    if (!person->booth || observation.cloud.size == 0 || BoothFitter::convincing(known.report)) return known;
    const BoothFitter::Learnt kept = person->booth->learnt();
    if (person->booth->shape_settled()) before = {person, kept};
    for (Candidate& c : candidates) c.booth->reset();
    Solution fresh = meet(observation, initial, chosen);
    fresh.iterations += known.iterations;
    if (fresh.found && (!known.found || fresh.report.evidence < kStrangerGain * known.report.evidence)) return fresh;
    for (Candidate& c : candidates) c.booth->reset();
    person->booth->remember(kept);
    chosen = person;
    rival = nullptr;
    // The refiner has to stand at the solution again.
    Solution again = person->booth->start_from(observation, {&known.q, 1});
    again.iterations += fresh.iterations;
    return again;
  }

  void start(const Observation& observation, const PoseVector* initial, bool exact) {
    Candidate* chosen = nullptr;
    const Solution best = person ? meet_again(observation, initial, chosen) : meet(observation, initial, chosen);
    following = best.found;
    bad_frames = 0;
    if (best.found) {
      person = chosen;
      adopt(*chosen, observation, best);
      person_energy = rival_energy = 0;
      rival_frames = 0;
    } else {
      rival = nullptr;
    }
    fill(*chosen, observation, best, best.found ? FitState::estimated : FitState::lost, exact);
  }

  Solution follow(Candidate& c, const Observation& observation) {
    Solution s = c.booth ? c.booth->track(observation) : c.paper->step(observation, {settings.seed, observation.frame}, nullptr);
    if (s.found && c.paper) c.paper->adopt(s);
    return s;
  }

  /// Both models go on; the one whose energy, summed over the frames so far, is lower speaks. `ours` is the person's solution of this frame.
  void compare_with_rival(const Observation& observation, Solution& ours) {
    Solution theirs = follow(*rival, observation);
    if (!theirs.found) {
      rival = nullptr;
      return;
    }
    person_energy += ours.report.energy;
    rival_energy += theirs.report.energy;
    if (rival_energy < person_energy) {
      std::swap(person, rival);
      std::swap(person_energy, rival_energy);
      std::swap(ours, theirs);
    }
    if (++rival_frames == kRivalFrames) rival = nullptr;
  }

  void fill(Candidate& c, const Observation& observation, const Solution& s, FitState state, bool exact) {
    last = &c;
    result.state = state;
    result.sex = c.model->sex();
    if (state != FitState::tracked) steady.reset();
    const Points3 vectors = c.model->bone_vectors(s.beta);
    result.q = c.booth && state == FitState::tracked ? steady.next(s.q, vectors) : s.q;
    result.beta = s.beta;
    result.iterations = s.iterations;
    result.unseen = s.unseen;
    c.diagnostics->describe(observation, exact, result);
    result.energy = EnergyTerms{};
    result.energy.shape = shape_energy(s.beta);
    result.energy.bone = bone_energy(vectors);
    result.energy.pose = pose_energy(*prior, s.q);
    result.energy.total = s.report.energy;
    if (c.booth) {
      result.energy.cloud_to_model = s.report.data;
      result.energy.free_space = s.report.free_space;
      if (state != FitState::lost) c.diagnostics->covariance(c.booth->refiner().information(), c.booth->shape_information(), result);
      result.body_accepted = c.booth->shape_settled() && !rival;
    } else {
      if (observation.cloud.size > 0 && state != FitState::lost) {
        const ParticleTerms terms = c.paper->terms(s);
        result.energy.point = static_cast<double>(terms.point), result.energy.plane = static_cast<double>(terms.plane);
      }
      // The swarm gives no curvature: each joint is as uncertain as the cloud is far.
      const double variance = result.cloud_to_model.mean * result.cloud_to_model.mean;
      for (auto& covariance : result.joint_covariance) covariance = variance * Eigen::Matrix3d::Identity();
      result.shape_covariance.resize(0, 0);
      result.body_accepted = state == FitState::tracked;
    }
  }

  void give_cloud(const Observation& observation) {
    if (swarm && !swarm->set_cloud(observation.cloud)) following = false;
  }

  void lose() {
    following = false;
    if (person->booth)
      person->booth->lose();
    else
      person->paper->reset();
  }

  void start_over() {
    if (person && person->booth && person->booth->shape_settled()) {
      lose();
      rival = nullptr;
      return;
    }
    const auto kept = before;
    reset();
    if (!kept.person) return;
    before = kept;
    person = kept.person;
    person->booth->remember(kept.body);
  }

  void step(const Observation& observation) {
    give_cloud(observation);
    if (following) {
      Solution s = follow(*person, observation);
      if (s.found) {
        if (rival) compare_with_rival(observation, s);
        if (person->booth && person->booth->shape_settled()) before.person = nullptr;
        bad_frames = 0;
        fill(*person, observation, s, FitState::tracked, false);
        return;
      }
      if (++bad_frames < kBadFramesUntilSearch) {
        fill(*person, observation, s, FitState::lost, false);
        return;
      }
      lose();
    }
    start(observation, nullptr, false);
  }
};

Estimator::Estimator(std::shared_ptr<const BodyModel> men, std::shared_ptr<const BodyModel> women, std::shared_ptr<const PosePrior> prior,
                     EstimatorSettings settings)
    : impl_(std::make_unique<Impl>(std::move(men), std::move(women), std::move(prior), settings)) {}
Estimator::~Estimator() = default;

void Estimator::reset() { impl_->reset(); }

void Estimator::start_over() { impl_->start_over(); }

const FitResult& Estimator::step(const Observation& observation) {
  impl_->step(observation);
  return impl_->result;
}

const FitResult& Estimator::fit(const Observation& observation, const PoseVector* initial) {
  impl_->reset();
  impl_->give_cloud(observation);
  impl_->start(observation, initial, true);
  return impl_->result;
}

const BodyModel& Estimator::model() const { return *impl_->last->model; }
const Vertices& Estimator::posed_vertices() const { return impl_->last->diagnostics->vertices(); }

DeviceReport Estimator::device_report() const { return impl_->guarded ? impl_->guarded->report() : DeviceReport{}; }

DeviceBytes Estimator::device_bytes() const { return impl_->on_device; }

std::size_t Estimator::memory_bytes() const {
  std::size_t bytes = sizeof(Impl);
  for (const auto& c : impl_->candidates) bytes += c.diagnostics->memory_bytes() + (c.booth ? c.booth->memory_bytes() : c.paper->memory_bytes());
  if (impl_->swarm) bytes += impl_->swarm->memory_bytes();
  return bytes;
}

}  // namespace booth::fit

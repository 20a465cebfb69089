// The energy, its scale and its truth.
#include "tests/bench/fit/problem.hpp"

#include "fit/body/poser.hpp"
#include "fit/track/paper_fitter.hpp"

namespace booth::bench {
namespace {

fit::SwarmSizes sizes(int particles, int iterations) {
  fit::SwarmSizes out;
  out.swarm.particles = particles;
  out.swarm.iterations = iterations;
  return out;
}

}  // namespace

Problem::Problem(const daemon::FitModels& models, const daemon::EstimatorFitter& fitter, const fit::PoseVector& before, std::vector<std::array<float, 3>> truth,
                 bool woman)
    : model_(woman ? models.women.get() : models.men.get()),
      prior_(*models.prior),
      observation_(fitter.observation()),
      truth_(std::move(truth)),
      pack_(*model_, prior_, {}) {
  field_.rebuild(observation_.cloud, pool_);
  evaluator_ = fit::make_cpu_swarm({&model_, 1}, prior_, sizes(16, 1), pool_);
  if (!evaluator_->set_cloud(observation_.cloud)) throw std::runtime_error("the back-end was lost");
  const auto n = static_cast<std::size_t>(dimensions());
  start_.assign(n, 0.0f);
  deviation_.assign(n, 1.0f);
  particle_.resize(n);
  for (int k = 0; k < fit::kDofs; ++k) {
    start_[static_cast<std::size_t>(k)] = static_cast<float>(before[k]);
    // As preset paper (fit/track/paper_fitter.cpp): metres and radians of the root, the prior's spread of the angles.
    deviation_[static_cast<std::size_t>(k)] = k < 3 ? 0.1f : k < 6 ? 0.2f : static_cast<float>(prior_.standard_deviation[k - 6]);
  }
}

void Problem::begin(double seconds, Trace& trace) {
  trace_ = &trace;
  limit_ = seconds;
  start_clock();
}

void Problem::start_clock() {
  allocations_ = 0;
  count_.reset();  // one at a time
  count_.emplace();
  trace_->start();
}

void Problem::stop_clock() {
  seconds_ = trace_->seconds();
  allocations_ = count_->so_far();
  count_.reset();
}

void Problem::insert(const Unknowns& absolute) {
  const Unknowns known(absolute.begin(), absolute.begin() + dimensions());
  trace_->insert(seconds_, energy_of(known), absolute);
}

Unknowns Problem::absolute(std::span<const double> scaled) const {
  Unknowns out(start_.size());
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = static_cast<double>(start_[k]) + static_cast<double>(deviation_[k]) * scaled[k];
  return out;
}

double Problem::energy_of(const Unknowns& absolute) {
  for (std::size_t k = 0; k < particle_.size(); ++k) particle_[k] = static_cast<float>(absolute[k]);
  fit::ParticleTerms t{};
  if (!evaluator_->evaluate(0, particle_, t)) throw std::runtime_error("the back-end was lost");
  const fit::PaperWeights w;
  return w.point * static_cast<double>(t.point) + w.plane * static_cast<double>(t.plane) + w.shape * static_cast<double>(t.shape) +
         w.bone * static_cast<double>(t.bone) + w.pose * static_cast<double>(t.pose);
}

double Problem::energy(std::span<const double> scaled) {
  if (trace_->seconds() > limit_) throw TimeIsUp();
  const Unknowns x = absolute(scaled);
  const double e = energy_of(x);
  trace_->offer(e, x);
  return e;
}

double Problem::vertex_error(std::span<const double> absolute) const {
  fit::PoseVector q;
  fit::ShapeVector beta(static_cast<int>(absolute.size()) - fit::kDofs);
  for (int k = 0; k < fit::kDofs; ++k) q[k] = absolute[static_cast<std::size_t>(k)];
  for (int k = 0; k < beta.size(); ++k) beta[k] = absolute[static_cast<std::size_t>(fit::kDofs + k)];
  fit::Poser poser(*model_, static_cast<int>(beta.size()), fit::PaperFitter::kVertices);
  poser.set_shape(beta);
  poser.set_pose(q);
  double sum = 0;
  for (int i = 0; i < poser.size(); ++i) {
    const auto& t = truth_[static_cast<std::size_t>(poser.model_vertex(i))];
    sum += static_cast<double>((poser.position(i) - Eigen::Vector3f(t[1], t[2], t[0])).norm());
  }
  return sum / poser.size();
}

fit::SwarmBackend& Problem::swarm(int iterations) {
  swarm_ = fit::make_cpu_swarm({&model_, 1}, prior_, sizes(fit::SwarmSettings{}.particles, iterations), pool_);
  return *swarm_;
}

}  // namespace booth::bench

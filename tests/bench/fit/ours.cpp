// Both presets: the swarm as published, for each number of iterations, and the hybrid, which has an energy of its own and is judged by the same yardstick.
#include <algorithm>

#include "fit/track/booth_fitter.hpp"
#include "tests/bench/fit/problem.hpp"

namespace booth::bench {
namespace {

/// The field's building is within the time: a booth has a new cloud for each frame. The inertia falls over the iterations there are, so that each number of
/// them is a swarm of its own.
void paper(Problem& problem) {
  for (const int n : {1, 2, 4, 6, 8, fit::SwarmSettings{}.iterations}) {
    auto& swarm = problem.swarm(n);
    problem.start_clock();
    fit::SwarmResult result;
    if (!swarm.set_cloud(problem.observation().cloud) || !swarm.minimise(0, problem.start(), problem.deviation(), {1, 1}, result)) return;
    problem.stop_clock();
    problem.insert(Unknowns(result.best.begin(), result.best.end()));
  }
}

/// As far as the paper's energy knows it, the solution; coefficients that were not used are zero.
Unknowns unknowns(const fit::PoseVector& q, const fit::ShapeVector& beta, std::size_t least) {
  Unknowns out(std::max(static_cast<std::size_t>(fit::kDofs + beta.size()), least), 0.0);
  for (int k = 0; k < fit::kDofs; ++k) out[static_cast<std::size_t>(k)] = q[k];
  for (int k = 0; k < beta.size(); ++k) out[static_cast<std::size_t>(fit::kDofs + k)] = beta[k];
  return out;
}

/// The first refinement of preset booth stopped after ever more iterations, and then the whole of what boothd does with a pose that it is given.
void booth_preset(Problem& problem) {
  constexpr int kCoefficients = 10, kVertices = 1500, kSamples = 300;  // of the fitter's coarse refiner
  const auto n = static_cast<std::size_t>(problem.dimensions());
  fit::WorkerPool pool(1);
  fit::PoseVector start;
  for (int k = 0; k < fit::kDofs; ++k) start[k] = static_cast<double>(problem.start()[static_cast<std::size_t>(k)]);
  fit::Refiner refiner(problem.model(), problem.prior(), {.shape_count = kCoefficients, .vertices = kVertices, .model_samples = kSamples}, pool);
  for (const int iterations : {2, 4, 8, 12}) {
    const fit::RefineSchedule schedule{.cloud_samples = 800, .model_samples = kSamples, .shape = true, .stages = {{iterations, 0.08f, 0.20f}}};
    fit::PoseVector q = start;
    fit::ShapeVector beta = fit::ShapeVector::Zero(kCoefficients);
    problem.start_clock();
    (void)refiner.refine(problem.observation(), {}, schedule, {}, {}, nullptr, q, beta);
    problem.stop_clock();
    problem.insert(unknowns(q, beta, n));
  }
  fit::BoothFitter fitter(problem.model(), problem.prior(), pool);
  problem.start_clock();
  const fit::Solution solution = fitter.start_from(problem.observation(), {&start, 1});
  problem.stop_clock();
  problem.insert(unknowns(solution.q, solution.beta, n));
}

}  // namespace

void add_ours(std::vector<Method>& out) {
  out.push_back({"booth", "boothd", booth_preset});
  out.push_back({"paper", "boothd", paper});
}

}  // namespace booth::bench

// pagmo's swarms and evolution strategy on the same energy.
#include <pagmo/algorithms/cmaes.hpp>
#include <pagmo/algorithms/pso.hpp>
#include <pagmo/algorithms/pso_gen.hpp>
#include <pagmo/population.hpp>
#include <pagmo/problem.hpp>

#include "fit/swarm/random.hpp"
#include "tests/bench/fit/problem.hpp"

namespace booth::bench {
namespace {

constexpr unsigned kManyGenerations = 1'000'000;  ///< the time ends it
constexpr unsigned kSeed = 1;

/// The library copies this; the problem stays where it is.
struct Adapter {
  Problem* problem = nullptr;
  pagmo::vector_double fitness(const pagmo::vector_double& x) const { return {problem->energy(x)}; }
  std::pair<pagmo::vector_double, pagmo::vector_double> get_bounds() const {
    const std::size_t n = problem != nullptr ? static_cast<std::size_t>(problem->dimensions()) : 1;
    return {pagmo::vector_double(n, -Problem::kReach), pagmo::vector_double(n, Problem::kReach)};
  }
};

/// A population about the start, as preset paper's is: normal, one deviation wide, the first on the start itself.
template <class Algorithm>
void evolve(Problem& problem, Algorithm algorithm, std::size_t size) {
  pagmo::population population{pagmo::problem{Adapter{&problem}}, 0, kSeed};
  try {
    const fit::Random random({kSeed, 7});
    for (std::size_t p = 0; p < size; ++p) {
      pagmo::vector_double x(static_cast<std::size_t>(problem.dimensions()), 0.0);
      for (std::size_t k = 0; k < x.size() && p > 0; ++k)
        x[k] = std::clamp(static_cast<double>(fit::Random::normal(random.words(static_cast<std::uint32_t>(p), static_cast<std::uint32_t>(k), 0))),
                          -Problem::kReach, Problem::kReach);
      population.push_back(x);
    }
    algorithm.set_seed(kSeed);
    (void)algorithm.evolve(population);
  } catch (const TimeIsUp&) {
  }
}

void pso(Problem& problem) { evolve(problem, pagmo::pso(kManyGenerations), 200); }
void pso_gen(Problem& problem) { evolve(problem, pagmo::pso_gen(kManyGenerations), 2000); }
void cmaes(Problem& problem) { evolve(problem, pagmo::cmaes(kManyGenerations, -1, -1, -1, -1, 0.5, 1e-9, 1e-9), 40); }

}  // namespace

void add_pagmo(std::vector<Method>& out) {
  out.push_back({"pso, 200 particles", "pagmo", pso});
  out.push_back({"pso_gen, 2000 particles", "pagmo", pso_gen});
  out.push_back({"cmaes, 40", "pagmo", cmaes});
}

}  // namespace booth::bench

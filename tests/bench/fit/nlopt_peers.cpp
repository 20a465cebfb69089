// nlopt's controlled random search, and its quasi-Newton method with differences for a gradient.
#include <nlopt.hpp>

#include "tests/bench/fit/problem.hpp"

namespace booth::bench {
namespace {

/// Exceptions must not pass through the C library's frames: the time's end is told to it instead.
struct Call {
  Problem* problem;
  nlopt::opt* optimiser;
  bool over = false;
};

double energy(const std::vector<double>& x, std::vector<double>& gradient, void* data) {
  auto& call = *static_cast<Call*>(data);
  try {
    const double e = call.problem->energy(x);
    if (gradient.empty()) return e;
    std::vector<double> moved = x;
    constexpr double kStep = 1e-3;  // deviations; the energy is in single precision
    for (std::size_t k = 0; k < x.size(); ++k) {
      moved[k] = x[k] + kStep;
      gradient[k] = (call.problem->energy(moved) - e) / kStep;
      moved[k] = x[k];
    }
    return e;
  } catch (const TimeIsUp&) {
    call.over = true;
    call.optimiser->force_stop();
    std::fill(gradient.begin(), gradient.end(), 0.0);
    return call.problem->trace().points().empty() ? 0.0 : call.problem->trace().points().back().energy;
  }
}

void run(Problem& problem, nlopt::algorithm algorithm) {
  const auto n = static_cast<unsigned>(problem.dimensions());
  nlopt::opt optimiser(algorithm, n);
  Call call{&problem, &optimiser};
  optimiser.set_min_objective(energy, &call);
  optimiser.set_lower_bounds(-Problem::kReach);
  optimiser.set_upper_bounds(Problem::kReach);
  optimiser.set_ftol_rel(1e-7);
  nlopt::srand(1);
  std::vector<double> x(n, 0.0);
  double best = 0;
  try {
    (void)optimiser.optimize(x, best);
  } catch (const nlopt::forced_stop&) {
  } catch (const std::runtime_error&) {
    // L-BFGS gives up where the energy's single precision allows no further step; what it had found is in the trace.
  }
}

void crs2(Problem& problem) { run(problem, nlopt::GN_CRS2_LM); }
void lbfgs(Problem& problem) { run(problem, nlopt::LD_LBFGS); }

}  // namespace

void add_nlopt(std::vector<Method>& out) {
  out.push_back({"CRS2", "nlopt", crs2});
  out.push_back({"L-BFGS", "nlopt", lbfgs});
}

}  // namespace booth::bench

// What --table may name.
#include "tests/accuracy/tables/tables.hpp"

namespace booth::accuracy {

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> all{
      {"1", "Table 1: bodies from clean clouds", plan_table_1},
      {"2", "Table 2: bodies from noisy clouds", plan_table_2},
      {"figure2", "Figure 2: with and without the pose prior", plan_figure2},
      {"figure3", "Figure 3: with and without the shape prior", plan_figure3},
      {"ablation", "One part left out at a time", plan_ablation},
      {"convergence", "Convergence of the published swarm", plan_convergence},
      {"start", "Found from nothing", plan_start},
      {"tracking", "Followed through motions", plan_tracking},
      {"measurements", "Measures of the body", plan_measurements},
      {"uncertainty", "What the stated uncertainty is worth", plan_uncertainty},
      {"speed", "What it costs", plan_speed},
  };
  return all;
}

}  // namespace booth::accuracy

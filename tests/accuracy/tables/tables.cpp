// What --table may name.
#include "tests/accuracy/tables/tables.hpp"

namespace booth::accuracy {

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> all{
      {"1", "Table 1: bodies from clean clouds", plan_table_1},
      {"2", "Table 2: bodies from noisy clouds", plan_table_2},
      {"start", "Found from nothing", plan_start},
      {"tracking", "Followed through motions", plan_tracking},
      {"measurements", "Measures of the body", plan_measurements},
      {"uncertainty", "What the stated uncertainty is worth", plan_uncertainty},
  };
  return all;
}

}  // namespace booth::accuracy

// The plan of every table.
#pragma once

#include "tests/accuracy/report/plan.hpp"

namespace booth::accuracy {

Plan plan_table_1(const Request& request);  ///< clean clouds
Plan plan_table_2(const Request& request);  ///< noisy clouds
Plan plan_figure2(const Request& request);  ///< with and without the pose prior
Plan plan_figure3(const Request& request);  ///< with and without the shape prior
Plan plan_ablation(const Request& request);
Plan plan_convergence(const Request& request);
Plan plan_start(const Request& request);
Plan plan_tracking(const Request& request);
Plan plan_measurements(const Request& request);
Plan plan_uncertainty(const Request& request);
Plan plan_speed(const Request& request);

}  // namespace booth::accuracy

// The verbs for programs that look after a booth: update hooks, monitoring. They register themselves as those of verbs.hpp do.
#pragma once

namespace CLI {
class App;
}

namespace booth::daemon {

void add_health_verb(CLI::App& app);   ///< health
void add_metrics_verb(CLI::App& app);  ///< metrics
void add_report_verb(CLI::App& app);   ///< report

}  // namespace booth::daemon

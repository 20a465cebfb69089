// The one layout of what a benchmark says as JSON (docs/reference/benchmarks.md), for boothctl and for booth-bench of the test tree.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace booth::daemon {

/// {"benchmark", "machine": {"processor", "cores", notes...}, "results"}; this machine is meant. `notes` are facts about the run that are no figures. Throws
/// std::bad_alloc only.
nlohmann::ordered_json bench_json(const std::string& benchmark, const std::vector<std::pair<std::string, std::string>>& notes, nlohmann::ordered_json results);

}  // namespace booth::daemon

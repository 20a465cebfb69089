// What machine this is, as the kernel tells.
#include "daemon/ctl/bench_json.hpp"

#include <algorithm>
#include <fstream>
#include <thread>

namespace booth::daemon {
namespace {

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("model name")) return line.substr(std::min(line.size(), line.find(':') + 2));
  return "unknown";
}

}  // namespace

nlohmann::ordered_json bench_json(const std::string& benchmark, const std::vector<std::pair<std::string, std::string>>& notes, nlohmann::ordered_json results) {
  nlohmann::ordered_json machine{{"processor", processor()}, {"cores", std::thread::hardware_concurrency()}};
  for (const auto& [key, value] : notes) machine[key] = value;
  return {{"benchmark", benchmark}, {"machine", std::move(machine)}, {"results", std::move(results)}};
}

}  // namespace booth::daemon

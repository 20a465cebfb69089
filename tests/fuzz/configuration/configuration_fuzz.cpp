// A configuration of any text: values within what their keys allow, or sentences that name the place; and what was understood goes out and comes in the same.
#include <cmath>
#include <stdexcept>
#include <string>

#include "daemon/config/change.hpp"
#include "daemon/config/keys.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/scratch.hpp"

namespace {

using namespace booth::daemon;
using booth::fuzz::require;

std::string all_values(const Config& config) {
  std::string out;
  for (const ConfigKey& key : config_keys()) out += format_config_value(key, config) + "\n";
  return out;
}

void check_values(const Config& config) {
  for (const ConfigKey& key : config_keys()) {
    Config copy = config;
    const ConfigSlot slot = key.slot(copy);
    if (auto* d = std::get_if<double*>(&slot)) require(std::isfinite(**d) && **d >= key.minimum && **d <= key.maximum, "a number is in its range");
    if (auto* i = std::get_if<std::int64_t*>(&slot))
      require(static_cast<double>(**i) >= key.minimum && static_cast<double>(**i) <= key.maximum, "a whole number is in its range");
  }
}

LoadedConfig read(const std::string& text, bool known_only, std::vector<std::string>& problems) {
  return load_settings({.file = {}, .assignments = {}, .files = ConfigSources::Files::none, .text = text, .text_name = "x", .known_only = known_only},
                       &problems);
}

void import(const std::string& text, const LoadedConfig& meant) {
  static const booth::fuzz::Scratch scratch;
  static const auto file = scratch.put("boothd.toml", "");
  const ConfigPlan plan = import_plan({.file = file, .assignments = {}}, text, "x", {});
  require(all_values(plan.after.config) == all_values(meant.config), "an import has what the export had");
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  for (const bool known_only : {false, true}) {
    std::vector<std::string> problems;
    const LoadedConfig read_once = read(text, known_only, problems);
    check_values(read_once.config);
    for (const auto& problem : problems) require(problem.starts_with("x:") || problem.starts_with("configuration: "), "a problem names its place");
    if (!problems.empty()) continue;
    const std::string exported = export_text(read_once, "0", "now");
    const LoadedConfig again = read(exported, false, problems);
    require(problems.empty() && all_values(again.config) == all_values(read_once.config) && again.named == read_once.named, "an export reads back the same");
    import(exported, read_once);
  }
  std::vector<std::string> problems;
  check_values(load_settings({.file = {}, .assignments = {text}, .files = ConfigSources::Files::none}, &problems).config);
  return 0;
}

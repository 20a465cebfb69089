// From --config and --set to the settings of a listener.
#include "daemon/ctl/network_options.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>

#include "daemon/config/load.hpp"
#include "daemon/ctl/verbs.hpp"
#include "daemon/dds/configured.hpp"

namespace booth::daemon {

void add_network_options(CLI::App& verb, NetworkOptions& options) {
  verb.add_option("--config", options.config, "Configuration file with the keys dds.*; without it /etc/boothd/boothd.toml where it exists");
  verb.add_option("--set", options.assignments, "key=value, over the file's (dds.domain=3, dds.interface=eth0 ...); may be given several times")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

DdsSettings network_settings(const NetworkOptions& options, const std::string& booth) {
  if (booth != "*" && (booth.empty() || booth.size() > 32 || booth.find_first_of("*?[ \t\n") != std::string::npos))
    throw VerbFailure("a booth is named by its booth.id, 1 to 32 characters, or by '*' for all of them", 64);
  try {
    ConfigSources sources;
    sources.file = options.config;
    sources.assignments = options.assignments;
    DdsSettings settings = dds_settings(load_config(sources));
    settings.booth = booth;
    return settings;
  } catch (const ConfigError& e) {
    throw VerbFailure(e.problems().empty() ? e.what() : e.problems().front(), 78);
  }
}

}  // namespace booth::daemon

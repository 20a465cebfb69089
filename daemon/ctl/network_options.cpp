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
  verb.add_option("--credentials", options.credentials, "Folder from `boothctl security issue`; switches dds.security on");
}

namespace {

/// What a person may hear is a file of that person's and not the booth's: the configuration's dds.credentials are a booth's and often not readable.
Config network_config(const NetworkOptions& options) {
  try {
    ConfigSources sources;
    sources.file = options.config;
    sources.assignments = options.assignments;
    Config config = load_config(sources);
    if (!options.credentials.empty()) {
      config.dds.security = "on";
      config.dds.credentials = options.credentials;
    }
    return config;
  } catch (const ConfigError& e) {
    throw VerbFailure(e.problems().empty() ? e.what() : e.problems().front(), 78);
  }
}

/// Whoever may hear some booths and asks for all gets those.
std::vector<std::string> heard_partitions(const PermissionFacts& permissions) {
  std::vector<std::string> out;
  for (const auto& rule : permissions.rules)
    if (!rule.publish) out.insert(out.end(), rule.partitions.begin(), rule.partitions.end());
  return std::find(out.begin(), out.end(), "*") == out.end() ? out : std::vector<std::string>{};
}

}  // namespace

DdsSettings network_settings(const NetworkOptions& options, const std::string& booth, Role role) {
  if (booth != "*" && (booth.empty() || booth.size() > 32 || booth.find_first_of("*?[ \t\n") != std::string::npos))
    throw VerbFailure("a booth is named by its booth.id, 1 to 32 characters, or by '*' for all of them", 64);
  const Config config = network_config(options);
  DdsSettings settings = dds_settings(config);
  settings.booth = booth;
  try {
    if (const auto credentials = dds_credentials(config, role, false)) {
      settings.identity = credentials->identity;
      if (booth == "*") settings.partitions = heard_partitions(credentials->permissions);
    }
  } catch (const std::exception& e) {
    throw VerbFailure(e.what(), 78);
  }
  return settings;
}

std::string credentials_folder(const NetworkOptions& options) {
  const Config config = network_config(options);
  return config.dds.credentials.empty() ? config.dds.self_issued : config.dds.credentials;
}

}  // namespace booth::daemon

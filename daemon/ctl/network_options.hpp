// The options of verbs that listen to booths on the network: where to listen comes from the configuration, as boothd's own.
#pragma once

#include <string>
#include <vector>

#include "daemon/dds/dds_settings.hpp"

namespace CLI {
class App;
}

namespace booth::daemon {

struct NetworkOptions {
  std::string config;
  std::vector<std::string> assignments;
};

/// Adds --config and --set to the verb; `options` outlives it.
void add_network_options(CLI::App& verb, NetworkOptions& options);

/// Where to listen for `booth` ("*": for all). Throws VerbFailure naming what is wrong with the configuration.
DdsSettings network_settings(const NetworkOptions& options, const std::string& booth);

}  // namespace booth::daemon

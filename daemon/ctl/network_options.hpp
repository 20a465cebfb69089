// The options of verbs that listen to booths on the network: where to listen comes from the configuration, as boothd's own.
#pragma once

#include <string>
#include <vector>

#include "daemon/dds/dds_settings.hpp"
#include "daemon/security/rights.hpp"

namespace CLI {
class App;
}

namespace booth::daemon {

struct NetworkOptions {
  std::string config;
  std::vector<std::string> assignments;
  std::string credentials;
};

/// Adds --config, --set and --credentials to the verb; `options` outlives it.
void add_network_options(CLI::App& verb, NetworkOptions& options);

/// Where to listen for `booth` ("*": for all), and with which credentials. `role`: whose are taken where nobody names a folder. Throws VerbFailure naming
/// what is wrong with the configuration or the credentials.
DdsSettings network_settings(const NetworkOptions& options, const std::string& booth, Role role = Role::viewer);

/// The folder that the configuration names for credentials: dds.credentials, else the self-issued fleet's. Throws as network_settings().
std::string credentials_folder(const NetworkOptions& options);

}  // namespace booth::daemon

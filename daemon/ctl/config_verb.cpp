// boothctl config reference: the page of all keys, made from the table that parses them.
#include <CLI/CLI.hpp>
#include <iostream>

#include "daemon/config/load.hpp"
#include "daemon/ctl/verbs.hpp"

namespace booth::daemon {

void add_config_verb(CLI::App& app) {
  CLI::App* verb = app.add_subcommand("config", "About the configuration");
  verb->require_subcommand(1);
  verb->add_subcommand("reference", "All keys with type, default and meaning, as Markdown")->callback([] { print_config_reference(std::cout); });
}

}  // namespace booth::daemon

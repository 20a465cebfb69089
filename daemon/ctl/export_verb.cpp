// placeholder, written next
#include <CLI/CLI.hpp>

#include "daemon/ctl/verbs.hpp"

namespace booth::daemon {
void add_export_verbs(CLI::App&) {}
}  // namespace booth::daemon

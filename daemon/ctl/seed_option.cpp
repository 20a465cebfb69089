// The range comes from the table of keys. CLI11 would take -1 for the greatest number without a sign.
#include "daemon/ctl/seed_option.hpp"

#include <CLI/CLI.hpp>
#include <cstdint>
#include <stdexcept>

#include "daemon/config/keys.hpp"

namespace booth::daemon {

CLI::Option* as_seed(CLI::Option* option) {
  const ConfigKey* key = find_config_key("fit.seed");
  if (key == nullptr) throw std::logic_error("fit.seed is no key any more");
  return option->check(CLI::Range(static_cast<std::int64_t>(key->minimum), static_cast<std::int64_t>(key->maximum)))->capture_default_str();
}

}  // namespace booth::daemon

// From files, drop-ins and --set to a Config, with every mistake named by file and line.
#pragma once

#include <filesystem>
#include <iosfwd>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/config/config.hpp"

namespace booth::daemon {

/// All that is wrong, one sentence a line: `file:line: key: what is wrong, what is allowed`.
class ConfigError : public std::runtime_error {
 public:
  explicit ConfigError(std::vector<std::string> problems);
  const std::vector<std::string>& problems() const { return problems_; }
  /// The only problem is a camera driver that this build does not have: the configuration is right, the device is not there.
  bool only_device_absent = false;

 private:
  std::vector<std::string> problems_;
};

struct ConfigSources {
  /// Empty: /etc/boothd/boothd.toml where it exists, else the defaults. A file named here must exist.
  std::filesystem::path file;
  std::vector<std::string> assignments;  ///< key=value; the value as in TOML, quotes around text may be left out
};

/// Later sources win: defaults, systemd's directories, the file, FILE.d/*.toml in alphabetical order, assignments.
/// Throws ConfigError with all problems of all sources.
Config load_config(const ConfigSources& sources);

/// What is right of it, without a word about the rest: for what must be shown of a boothd that cannot start. Never throws.
Config load_what_is_right(const ConfigSources& sources);

/// The resolved configuration as TOML that load_config() accepts.
void print_config(const Config& config, std::ostream& out);

/// docs/reference/configuration.md.
void print_config_reference(std::ostream& out);

}  // namespace booth::daemon

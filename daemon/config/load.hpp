// From files, drop-ins and --set to a Config, with every mistake named by file and line.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/config/config.hpp"
#include "daemon/config/key_problem.hpp"

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
  enum class Files : std::uint8_t { all, without_drop_ins, none } files = Files::all;
  std::string text{}, text_name{};  ///< TOML in memory that comes after the drop-ins, and what its errors call it
  bool known_only = false;          ///< keys of `text` that this version does not know are passed over
};

/// Of the configuration's keys; a file may say `version = N` before its first table, and is of this one where it does not.
inline constexpr std::int64_t kConfigVersion = 1;

/// A configuration, and which of its keys somebody has written down.
struct LoadedConfig {
  Config config;
  std::vector<std::string> named;        ///< keys that some source names, each once, in alphabetical order
  std::vector<std::string> passed_over;  ///< keys of ConfigSources::text that are not known, where that is allowed
  bool is_export = false;                ///< some source has an [export] table (docs/guide/operate.md)
  std::vector<std::string> warnings;     ///< of files of the next version: a sentence about the file, and one for each key that was passed over
  /// Where each key got its value, as errors say it: `FILE:LINE`, `--set KEY=VALUE`, `$STATE_DIRECTORY`. A key with its default is not here.
  std::map<std::string, std::string, std::less<>> places;
  /// Keys whose value is not the one that was meant, because that is wrong, or may stand under a misspelt key or in a file that cannot be read.
  std::set<std::string, std::less<>> in_doubt;
  bool only_device_absent = false;  ///< as ConfigError's, of the problems that were put aside

  /// `FILE:LINE: key: sentence` with the place of that of the keys which the sentence names; else of the one whose value, a path, it names; else of the first.
  /// Where that one has its default, or there are no keys, the sentence alone. Never throws but for memory.
  std::string placed(const KeyProblem& problem) const;
};

/// The format of [export] tables that this version writes; it reads this one and its neighbours (hal/file_version.hpp), the next one with a warning.
inline constexpr int kExportFormat = 1;

/// Later sources win: defaults, systemd's directories, the file, FILE.d/*.toml in alphabetical order, `text`, assignments.
/// Throws ConfigError with all problems of all sources, unless `problems` is given: then they are put there, and what is right is returned. In a file of the
/// next version a key that is not known is no problem; a value that is not known is one, whatever the version.
LoadedConfig load_settings(const ConfigSources& sources, std::vector<std::string>* problems = nullptr);

/// The configuration alone, and LoadedConfig::warnings. Throws ConfigError.
Config load_config(const ConfigSources& sources, std::vector<std::string>* warnings = nullptr);

/// /etc/boothd/boothd.toml, or the file that the sources name.
std::filesystem::path config_file(const ConfigSources& sources);
/// FILE.d/*.toml in the order in which they are read.
std::vector<std::filesystem::path> config_drop_ins(const std::filesystem::path& file);

/// What is right of it, without a word about the rest: for what must be shown of a boothd that cannot start. Never throws.
Config load_what_is_right(const ConfigSources& sources);

/// The resolved configuration as TOML that load_config() accepts.
void print_config(const Config& config, std::ostream& out);

/// docs/reference/configuration.md.
void print_config_reference(std::ostream& out);

}  // namespace booth::daemon

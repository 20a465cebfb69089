// A whole configuration out of a booth and into one: planned and checked in memory, then taken over by the renaming of one file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/config/load.hpp"

namespace booth::daemon {

/// What somebody has written down, as one file that import_plan() takes and that is a configuration file, too. Keys that nobody names are not in it, so that
/// another version's defaults stay that version's. `software` and `utc` go into its [export] table.
std::string export_text(const LoadedConfig& settings, const std::string& software, const std::string& utc);

/// What is going to happen to a configuration; nothing has happened yet.
struct ConfigPlan {
  std::filesystem::path file;  ///< boothd.toml; changes go to FILE.d
  LoadedConfig before, after;  ///< what is right of the present one; `after.named` are the keys that will be written
  bool replaces_file = false;  ///< FILE itself has mistakes and is set aside
  std::vector<std::string> notes;
  std::string settled;   ///< names every key that any source names: read last, it decides alone
  std::string imported;  ///< the same over FILE alone
};

struct ImportOptions {
  bool keep_box = false;    ///< booth.id, sensors and calibration stay those of this box
  bool known_only = false;  ///< keys that this version does not know are left out
};

/// Throws ConfigError with every mistake of the text; `name` is what it calls the text.
ConfigPlan import_plan(const ConfigSources& now, const std::string& text, const std::string& name, const ImportOptions& options);

/// Back to the defaults. Kept are the keys that say who this booth is, where its sensors and their calibration are, and how it is secured; with `everything`
/// only dds.security, which no reset switches off. Throws ConfigError.
ConfigPlan reset_plan(const ConfigSources& now, bool everything);

/// A key whose value changes; both as TOML writes them.
struct ConfigChange {
  std::string key, before, after;
};

/// In the order of the reference page.
std::vector<ConfigChange> changes_of(const ConfigPlan& plan);

/// `stamp`, or with a number behind it where FILE.before-STAMP is there already: two changes within a second each keep what was before them.
std::string free_stamp(const std::filesystem::path& file, const std::string& stamp);

/// The steps that carry the plan out, each harmless to interrupt: before the second the old configuration is read, after it the new one. `stamp` is in the
/// names of what is kept: FILE.before-STAMP, an export of the configuration before (the last ten of those), and drop-ins as NAME.before-STAMP. Steps throw
/// std::runtime_error naming the path.
std::vector<std::function<void()>> steps_of(const ConfigPlan& plan, const std::string& stamp, const std::string& software, const std::string& utc);

/// Files of `config` (keys that name one) that are not on this machine, as "key: path".
std::vector<std::string> missing_files(const Config& config);

}  // namespace booth::daemon

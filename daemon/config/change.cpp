// The new configuration is a drop-in. While it is put in place it has a name that is read last and decides every key alone; then nothing else counts any more
// and can be cleared away at leisure.
#include "daemon/config/change.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "daemon/config/keys.hpp"
#include "daemon/io/atomic_file.hpp"
#include "daemon/io/backups.hpp"

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLast = "zz-imported.toml";
constexpr const char* kImported = "00-imported.toml";
constexpr std::size_t kBackups = 10;
constexpr const char* kSecurity = "dds.security";

/// What makes this box this one.
constexpr std::string_view kOfTheBox[] = {"booth.id", "cameras.kinect2.serials", "cameras.kinect2.calibration"};
/// What a text that does not name them leaves alone: silence never makes a booth less safe.
constexpr std::string_view kProtective[] = {kSecurity, "privacy.seal_to"};
constexpr std::string_view kKeptByReset[] = {
    "booth.id",        "cameras.kinect2.serials", "cameras.kinect2.calibration", "cameras.kinect2.cache", kSecurity, "dds.credentials",
    "dds.self_issued", "privacy.seal_to"};

template <class List>
bool lists(const List& list, std::string_view name) {
  return std::find(std::begin(list), std::end(list), name) != std::end(list);
}

std::string value_of(std::string_view name, const Config& config) { return format_config_value(*find_config_key(name), config); }

void copy_value(const ConfigKey& key, const Config& from, Config& to) {
  Config source = from;
  const ConfigSlot read = key.slot(source), write = key.slot(to);
  std::visit([&write](auto* value) { *std::get<decltype(value)>(write) = *value; }, read);
}

/// The boothd before this one finds keys here that it does not know, and is told by this why: it passes over them instead of refusing to start.
std::string version_line() { return fmt::format("version = {}\n", kConfigVersion); }

/// The keys as TOML, table by table in the order of the reference page.
std::string tables_text(const std::set<std::string, std::less<>>& names, const Config& config) {
  std::string out, table;
  for (const ConfigKey& key : config_keys()) {
    if (!names.contains(key.name)) continue;
    const auto dot = key.name.rfind('.');
    const std::string of(key.name.substr(0, dot));
    if (of != table) out += fmt::format("\n[{}]\n", of);
    table = of;
    out += fmt::format("{} = {}\n", key.name.substr(dot + 1), format_config_value(key, config));
  }
  return out;
}

bool same(const Config& a, const Config& b) {
  const auto keys = config_keys();
  return std::all_of(keys.begin(), keys.end(), [&](const ConfigKey& key) { return format_config_value(key, a) == format_config_value(key, b); });
}

/// What there is, and what of it is right.
ConfigPlan look_at(const ConfigSources& now, ConfigSources& beneath) {
  ConfigPlan plan;
  plan.file = config_file(now);
  std::error_code error;
  if (!now.file.empty() && !fs::exists(now.file, error))
    throw ConfigError({fmt::format("{}: does not exist; name the configuration of a booth", now.file.string())});
  std::vector<std::string> problems, of_file;
  plan.before = load_settings({.file = now.file, .assignments = {}}, &problems);
  beneath = {.file = now.file, .assignments = {}, .files = ConfigSources::Files::without_drop_ins};
  (void)load_settings(beneath, &of_file);
  plan.replaces_file = !of_file.empty();
  if (plan.replaces_file) {
    beneath = {.file = {}, .assignments = {}, .files = ConfigSources::Files::none};
    plan.notes.push_back(fmt::format("{} has mistakes and is set aside ({})", plan.file.string(), of_file.front()));
  } else if (!problems.empty()) {
    plan.notes.push_back(fmt::format("the configuration before has mistakes ({})", problems.front()));
  }
  for (const auto& path : config_drop_ins(plan.file))
    if (path.filename().string() > kLast)
      throw ConfigError({fmt::format("{}: its name comes after {} in the alphabet, so that it would win; rename it", path.string(), kLast)});
  if (!problems.empty()) plan.before.config.dds.security = "on";  // what cannot be read may have switched it on
  return plan;
}

/// Fills the texts from `after.config`, and proves by reading them that they say what they should. `given`: keys that are written whatever they are.
void write_texts(ConfigPlan& plan, const ConfigSources& beneath, const std::vector<std::string>& given) {
  const Config base = load_config(beneath);
  std::set<std::string, std::less<>> names(given.begin(), given.end());
  for (const ConfigKey& key : config_keys())
    if (format_config_value(key, plan.after.config) != format_config_value(key, base)) names.emplace(key.name);
  plan.after.named.assign(names.begin(), names.end());
  const std::string version = version_line();
  const std::string head = "# Written by `boothctl config`. Change it, or put keys into other files here: those that come later in the alphabet win.\n";
  plan.imported = names.empty() ? "" : head + version + tables_text(names, plan.after.config);
  const LoadedConfig file = load_settings(beneath);
  names.insert(file.named.begin(), file.named.end());
  names.insert(plan.before.named.begin(), plan.before.named.end());
  plan.settled = "# `boothctl config` was interrupted after its change took effect. Run it again, or rename this file to " + std::string(kImported) +
                 " and delete the others.\n" + version + tables_text(names, plan.after.config);

  ConfigSources over = beneath;
  over.text_name = kImported;
  over.text = plan.imported;
  if (!same(load_config(over), plan.after.config)) throw std::logic_error("the imported configuration does not read back as it was meant");
}

void keep_newest(const fs::path& file, const fs::path& just_written) {
  const std::string stem = file.filename().string() + ".before-";
  std::vector<fs::path> kept;
  std::error_code error;
  for (fs::directory_iterator it(file.parent_path().empty() ? fs::path(".") : file.parent_path(), error), end; !error && it != end; it.increment(error))
    if (const std::string name = it->path().filename().string(); name.starts_with(stem)) kept.push_back(file.parent_path() / name);
  keep_newest_backups(std::move(kept), just_written, kBackups);
}

void rename_or_throw(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::rename(from, to, error);
  if (error) throw std::runtime_error(fmt::format("{} cannot be renamed to {}: {}", from.string(), to.filename().string(), error.message()));
}

}  // namespace

std::string export_text(const LoadedConfig& settings, const std::string& software, const std::string& utc) {
  const std::set<std::string, std::less<>> names(settings.named.begin(), settings.named.end());
  return fmt::format(
             "# The configuration of booth {}: every key that was set, no defaults. `boothctl config import` takes it.\n"
             "# It names files (calibration, credentials, keys); what is in them is not here.\n{}\n"
             "[export]\nformat = {}\nsoftware = \"{}\"\nutc = \"{}\"\n",
             value_of("booth.id", settings.config), version_line(), kExportFormat, software, utc) +
         tables_text(names, settings.config);
}

ConfigPlan import_plan(const ConfigSources& now, const std::string& text, const std::string& name, const ImportOptions& options) {
  ConfigSources beneath;
  ConfigPlan plan = look_at(now, beneath);
  const LoadedConfig wanted =
      load_settings({.file = {}, .assignments = {}, .files = ConfigSources::Files::none, .text = text, .text_name = name, .known_only = options.known_only});
  if (!wanted.is_export)
    throw ConfigError(
        {fmt::format("{}: is no export of a boothd ([export] is missing); keys that you wrote yourself belong into {}.d", name, plan.file.string())});
  for (const auto& key : wanted.passed_over) plan.notes.push_back(fmt::format("{}: {} is not known to this version and is left out", name, key));
  plan.notes.insert(plan.notes.end(), wanted.warnings.begin(), wanted.warnings.end());
  plan.after.config = wanted.config;
  for (const ConfigKey& key : config_keys()) {
    const bool given = lists(wanted.named, key.name);
    if ((options.keep_box && lists(kOfTheBox, key.name)) || (!given && lists(kProtective, key.name))) copy_value(key, plan.before.config, plan.after.config);
  }
  write_texts(plan, beneath, wanted.named);
  return plan;
}

ConfigPlan reset_plan(const ConfigSources& now, bool everything) {
  ConfigSources beneath;
  ConfigPlan plan = look_at(now, beneath);
  plan.after.config = load_config({.file = {}, .assignments = {}, .files = ConfigSources::Files::none});
  for (const ConfigKey& key : config_keys())
    if (key.name == kSecurity || (!everything && lists(kKeptByReset, key.name))) copy_value(key, plan.before.config, plan.after.config);
  write_texts(plan, beneath, {});
  return plan;
}

std::vector<ConfigChange> changes_of(const ConfigPlan& plan) {
  std::vector<ConfigChange> out;
  for (const ConfigKey& key : config_keys()) {
    std::string before = format_config_value(key, plan.before.config), after = format_config_value(key, plan.after.config);
    if (before != after) out.push_back({std::string(key.name), std::move(before), std::move(after)});
  }
  return out;
}

std::string free_stamp(const fs::path& file, const std::string& stamp) {
  const auto taken = [&](const std::string& one) {
    std::error_code error;
    return fs::exists(fs::symlink_status(file.string() + ".before-" + one, error));
  };
  std::string out = stamp;
  for (int i = 2; taken(out); ++i) out = fmt::format("{}-{:02}", stamp, i);  // two digits: the oldest come first in the alphabet, and go first
  return out;
}

std::vector<std::function<void()>> steps_of(const ConfigPlan& plan, const std::string& stamp, const std::string& software, const std::string& utc) {
  const fs::path file = plan.file, folder = file.string() + ".d";
  const std::string ending = ".before-" + stamp;
  std::vector<std::function<void()>> out;
  out.emplace_back([=] {
    std::error_code error;
    fs::create_directories(folder, error);
    if (error) throw std::runtime_error(fmt::format("{} cannot be made: {}; nothing was changed", folder.string(), error.message()));
    write_file_atomically(fs::path(file.string() + ending), export_text(plan.before, software, utc));
  });
  out.emplace_back([=] { write_file_atomically(folder / kLast, plan.settled); });
  if (plan.replaces_file)
    out.emplace_back([=] {
      rename_or_throw(file, file.string() + ".broken-" + stamp);
      write_file_atomically(file, "# What stood here had mistakes; boothctl config put it aside, beside this file.\n");
    });
  for (const auto& path : config_drop_ins(file)) {
    const std::string name = path.filename().string();
    if (name != kLast && name != kImported) out.emplace_back([=] { rename_or_throw(path, path.string() + ending); });
  }
  out.emplace_back([=] {
    std::error_code error;
    if (plan.imported.empty())
      fs::remove(folder / kImported, error);
    else
      write_file_atomically(folder / kImported, plan.imported);
    if (error) throw std::runtime_error(fmt::format("{} cannot be deleted: {}", (folder / kImported).string(), error.message()));
  });
  out.emplace_back([=] {
    std::error_code error;
    fs::remove(folder / kLast, error);
    if (error) throw std::runtime_error(fmt::format("{} cannot be deleted: {}", (folder / kLast).string(), error.message()));
    keep_newest(file, file.string() + ending);
  });
  return out;
}

std::vector<std::string> missing_files(const Config& config) {
  std::vector<std::string> out;
  std::error_code error;
  for (const std::string_view name : {"cameras.kinect2.calibration", "cameras.recording.path", "models.directory", "privacy.seal_to", "dds.credentials"}) {
    Config copy = config;
    const std::string& path = *std::get<std::string*>(find_config_key(name)->slot(copy));
    if (!path.empty() && !fs::exists(path, error)) out.push_back(fmt::format("{}: {}", name, path));
  }
  return out;
}

}  // namespace booth::daemon

// Reads configuration with toml++ and checks it against the table of keys.
#include "daemon/config/load.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ostream>

#include "daemon/config/keys.hpp"
#include "daemon/config/toml_document.hpp"
#include "daemon/io/file_bytes.hpp"
#include "hal/file_version.hpp"

namespace booth::daemon {
namespace {

constexpr std::uintmax_t kMaxFileBytes = 1 << 20;

std::string join_lines(const std::vector<std::string>& lines) {
  std::string out;
  for (const auto& line : lines) out += (out.empty() ? "" : "\n") + line;
  return out;
}

/// Collects problems while values are taken over.
struct Loader {
  Config config;
  std::vector<std::string> problems, warnings;
  bool newer = false;      ///< the file that is being read is of the next version
  std::size_t absent = 0;  ///< problems that are camera drivers of another build
  std::set<std::string> named;
  std::map<std::string, std::string, std::less<>> places;  ///< LoadedConfig's
  std::set<std::string, std::less<>> in_doubt;             ///< LoadedConfig's
  std::vector<std::string> passed_over;
  bool pass_over = false;  ///< what is not known
  bool is_export = false;

  void problem(const std::string& place, std::string_view key, const std::string& what) {
    problems.push_back(key.empty() ? fmt::format("{}: {}", place, what) : fmt::format("{}: {}: {}", place, key, what));
  }

  /// Of a key, or all of a table; "": of all there are.
  void doubt(std::string_view name) {
    for (const ConfigKey& key : config_keys())
      if (name.empty() || key.name == name || (key.name.starts_with(name) && key.name[name.size()] == '.')) in_doubt.emplace(key.name);
  }
  bool is_sound(std::initializer_list<std::string_view> keys) const {
    return std::none_of(keys.begin(), keys.end(), [&](std::string_view key) { return in_doubt.contains(key); });
  }

  /// Keys that are right one by one and not together: the first is complained about, at the place of the first that somebody set.
  void contradiction(std::initializer_list<std::string_view> keys, const std::string& what) {
    std::string place, others;
    for (const auto key : keys) {
      const auto found = places.find(key);
      if (found == places.end()) continue;
      if (place.empty())
        place = found->second;
      else
        others += fmt::format("; {} is set in {}", key, found->second);
    }
    problem(place.empty() ? "configuration" : place, *keys.begin(), what + others);
    doubt(*keys.begin());  // what follows from it is no second mistake
  }

  void text_value(const ConfigKey& key, const std::string& place, const std::string& value, std::string& slot) {
    if (std::find(key.absent.begin(), key.absent.end(), value) != key.absent.end()) {
      absent += key.name == "cameras.driver";
      return problem(place, key.name, fmt::format("\"{}\" is not in this build; allowed is {}", value, allowed_values(key)));
    }
    if (!key.choices.empty() && std::find(key.choices.begin(), key.choices.end(), value) == key.choices.end()) {
      return problem(place, key.name, fmt::format("\"{}\" is not known; allowed is {}", value, allowed_values(key)));
    }
    if (key.check) {
      if (const std::string wrong = key.check(value); !wrong.empty()) return problem(place, key.name, fmt::format("\"{}\" {}", value, wrong));
    }
    slot = value;
  }

  void value(const ConfigKey& key, const std::string& place, const toml::node& node) {
    named.emplace(key.name);
    const std::size_t before = problems.size();
    take(key, place, node);
    if (problems.size() > before) return doubt(key.name);
    places[std::string(key.name)] = place;
    in_doubt.erase(std::string(key.name));
  }

  void take(const ConfigKey& key, const std::string& place, const toml::node& node) {
    const auto wrong_type = [&] { problem(place, key.name, fmt::format("has the wrong type; allowed is {}", allowed_values(key))); };
    const auto in_range = [&](double v) {
      if (std::isfinite(v) && v >= key.minimum && v <= key.maximum) return true;
      problem(place, key.name, fmt::format("{} is out of range; allowed is {}", v, allowed_values(key)));
      return false;
    };
    const ConfigSlot slot = key.slot(config);
    if (auto* b = std::get_if<bool*>(&slot)) {
      const auto v = node.value_exact<bool>();
      if (!v) return wrong_type();
      if (*v && !key.absent.empty()) return problem(place, key.name, "is not in this build; allowed is false");
      **b = *v;
    } else if (auto* i = std::get_if<std::int64_t*>(&slot)) {
      const auto v = node.value_exact<std::int64_t>();
      if (!v) return wrong_type();
      if (in_range(static_cast<double>(*v))) **i = *v;
    } else if (auto* d = std::get_if<double*>(&slot)) {
      const auto v = node.is_integer() || node.is_floating_point() ? node.value<double>() : std::nullopt;
      if (!v) return wrong_type();
      if (in_range(*v)) **d = *v;
    } else if (auto* s = std::get_if<std::string*>(&slot)) {
      const auto v = node.value_exact<std::string>();
      if (!v) return wrong_type();
      text_value(key, place, *v, **s);
    } else if (auto* l = std::get_if<std::vector<std::string>*>(&slot)) {
      const toml::array* array = node.as_array();
      if (!array) return wrong_type();
      std::vector<std::string> list;
      for (const auto& item : *array) {
        const auto v = item.value_exact<std::string>();
        if (!v) return wrong_type();
        list.emplace_back();
        text_value(key, place, *v, list.back());
      }
      **l = std::move(list);
    }
  }

  void unknown(const std::string& place, const std::string& name) {
    if (pass_over) return passed_over.push_back(name);
    if (newer) return warnings.push_back(fmt::format("{}: {}: is not a key of this version of boothd, and passed over", place, name));
    const std::string_view near = nearest_config_key(name);
    if (!near.empty()) doubt(near);
    problem(place, name, near.empty() ? "is not a key of boothd" : fmt::format("is not a key of boothd; did you mean {}?", near));
  }

  /// Who wrote an exported file: nothing that is set by it, so that an export is a configuration file like any other.
  void export_table(const std::string& place, const toml::node& node) {
    is_export = true;
    const toml::table* t = node.as_table();
    const auto format = t == nullptr ? std::nullopt : (*t)["format"].value_exact<std::int64_t>();
    if (!format || *format < 1) return problem(place, "export", "must be the table that `boothctl config export` writes, with its format");
    const auto verdict = hal::judge_file_version(*format, kExportFormat);
    if (verdict == hal::FileVersion::readable) return;
    const std::string sentence = hal::file_version_complaint(*format, kExportFormat);
    if (verdict == hal::FileVersion::newer)
      warnings.push_back(fmt::format("{}: export.format: {}", place, sentence));
    else
      problem(place, "export.format", sentence);
  }

  void table(const std::string& prefix, const std::string& file, const toml::table& t) {
    for (const auto& [k, node] : t) {
      const std::string name = prefix + std::string(k.str());
      const std::string place = fmt::format("{}:{}", file, k.source().begin.line);
      if (const ConfigKey* key = find_config_key(name)) {
        value(*key, place, node);
        continue;
      }
      if (name == "export") {
        export_table(place, node);
        continue;
      }
      const auto keys = config_keys();
      const bool is_prefix = std::any_of(keys.begin(), keys.end(), [&](const ConfigKey& c) { return c.name.starts_with(name + "."); });
      if (const toml::table* inner = node.as_table(); inner && is_prefix) {
        table(name + ".", file, *inner);
      } else if (is_prefix) {
        doubt(name);
        problem(place, name, "must be a table");
      } else {
        unknown(place, name);
      }
    }
  }

  /// Takes the file's version out of it.
  void version(const std::string& file, toml::table& root) {
    const toml::node* node = root.get("version");
    if (!node) return;
    const std::string place = fmt::format("{}:{}", file, node->source().begin.line);
    if (const auto found = node->value_exact<std::int64_t>(); !found) {
      problem(place, "version", "must be a whole number");
    } else if (const auto verdict = hal::judge_file_version(*found, kConfigVersion); verdict != hal::FileVersion::readable) {
      newer = verdict == hal::FileVersion::newer;
      const std::string sentence = hal::file_version_complaint(*found, kConfigVersion);
      if (newer)
        warnings.push_back(fmt::format("{}: {}", place, sentence));
      else
        problem(place, "version", sentence);
    }
    root.erase("version");
  }

  void file(const std::filesystem::path& path) {
    std::string text;
    try {
      text = read_file_bytes(path, kMaxFileBytes);
    } catch (const std::exception& e) {  // a bad sector must not look like a file without keys: security would be off
      doubt("");
      const std::string what = e.what(), opening = "cannot read " + path.string() + ": ";
      return problem(path.string(), "", "cannot be read: " + (what.starts_with(opening) ? what.substr(opening.size()) : what));
    }
    toml_text(text, path.string());
  }

  void toml_text(const std::string& text, const std::string& name) {
    if (text.size() > kMaxFileBytes) {
      doubt("");
      return problem(name, "", fmt::format("is {} bytes long; a configuration has at most {}", text.size(), kMaxFileBytes));
    }
    try {
      toml::table root = parse_toml(text, name);
      version(name, root);
      table("", name, root);
      newer = false;
    } catch (const toml::parse_error& e) {
      doubt("");
      problem(fmt::format("{}:{}", name, e.source().begin.line), "", fmt::format("not TOML: {}", e.description()));
    }
  }

  void assignment(const std::string& text) {
    const std::string place = "--set " + text;
    const auto equals = text.find('=');
    if (equals == std::string::npos) return problem(place, "", "must have the form key=value");
    const std::string name = text.substr(0, equals), raw = text.substr(equals + 1);
    const ConfigKey* key = find_config_key(name);
    if (!key) return unknown(place, name);
    const bool is_text = std::holds_alternative<std::string*>(key->slot(config));
    const bool bare = is_text && !(raw.size() >= 2 && (raw.front() == '"' || raw.front() == '\'') && raw.back() == raw.front());
    if (bare) return value(*key, place, toml::value<std::string>(raw));
    try {
      const toml::table parsed = parse_toml("value = " + raw);
      const toml::node* node = parsed.get("value");
      if (!node || parsed.size() != 1) {
        doubt(name);
        return problem(place, name, fmt::format("has no single value; allowed is {}", allowed_values(*key)));
      }
      value(*key, place, *node);
    } catch (const toml::parse_error&) {
      doubt(name);
      problem(place, name, fmt::format("\"{}\" is not a value; allowed is {}", raw, allowed_values(*key)));
    }
  }
};

}  // namespace

ConfigError::ConfigError(std::vector<std::string> problems) : std::runtime_error(join_lines(problems)), problems_(std::move(problems)) {}

namespace {

Loader collect(const ConfigSources& sources) {
  Loader loader;
  const auto from = [&loader](const char* variable, std::string_view key, std::string& slot, const std::string& value) {
    slot = value;
    loader.places[std::string(key)] = std::string("$") + variable;
  };
  if (const char* run = std::getenv("RUNTIME_DIRECTORY"); run && *run)
    from("RUNTIME_DIRECTORY", "control.socket", loader.config.control.socket, std::string(run) + "/control.sock");
  if (const char* variable = "STATE_DIRECTORY", *state = std::getenv(variable); state && *state) {
    const std::string folder(state);
    from(variable, "session.directory", loader.config.session.directory, folder + "/sessions");
    from(variable, "record.directory", loader.config.record.directory, folder + "/recordings");
    from(variable, "cameras.kinect2.calibration", loader.config.cameras.kinect2.calibration, folder + "/calibration.toml");
    from(variable, "cameras.kinect2.cache", loader.config.cameras.kinect2.cache, folder + "/kinect2");
    from(variable, "dds.self_issued", loader.config.dds.self_issued, folder + "/security");
  }

  if (sources.files != ConfigSources::Files::none) {
    const std::filesystem::path file = config_file(sources);
    std::error_code error;
    if (!sources.file.empty() || std::filesystem::exists(file, error)) loader.file(file);
    if (sources.files == ConfigSources::Files::all)
      for (const auto& path : config_drop_ins(file)) loader.file(path);
  }
  if (!sources.text_name.empty()) {
    loader.pass_over = sources.known_only;
    loader.toml_text(sources.text, sources.text_name);
    loader.pass_over = false;
  }
  for (const auto& text : sources.assignments) loader.assignment(text);
  return loader;
}

/// Of the keys that are right one by one.
void check_together(Loader& loader) {
  const Config& c = loader.config;
  if (c.cameras.driver == "recording" && c.cameras.recording.path.empty() && loader.is_sound({"cameras.recording.path", "cameras.driver"}))
    loader.contradiction({"cameras.recording.path", "cameras.driver"}, "must name a recording when cameras.driver is \"recording\"");
  if (c.cameras.driver == "synthetic" && c.cameras.minimum > c.cameras.synthetic.count &&
      loader.is_sound({"cameras.minimum", "cameras.synthetic.count", "cameras.driver"}))
    loader.contradiction(
        {"cameras.minimum", "cameras.synthetic.count"},
        fmt::format("is {}, but the simulated booth has only {} cameras (cameras.synthetic.count)", c.cameras.minimum, c.cameras.synthetic.count));
  if (c.dds.security == "on" && c.dds.domain > 230 && loader.is_sound({"dds.domain", "dds.security"}))
    loader.contradiction({"dds.domain", "dds.security"}, fmt::format("is {}; DDS Security (dds.security) knows domains from 0 to 230", c.dds.domain));
}

/// Whether the key's value is a path that the sentence names.
bool names_value(const std::string& sentence, std::string_view name, const Config& config) {
  const ConfigKey* key = find_config_key(name);
  Config copy = config;
  const ConfigSlot slot = key == nullptr ? ConfigSlot{} : key->slot(copy);
  const auto* text = std::get_if<std::string*>(&slot);
  return text != nullptr && *text != nullptr && (*text)->find('/') != std::string::npos && sentence.find(**text) != std::string::npos;
}

}  // namespace

std::filesystem::path config_file(const ConfigSources& sources) {
  return sources.file.empty() ? std::filesystem::path("/etc/boothd/boothd.toml") : sources.file;
}

std::vector<std::filesystem::path> config_drop_ins(const std::filesystem::path& file) {
  std::vector<std::filesystem::path> out;
  std::error_code error;
  for (std::filesystem::directory_iterator it(file.string() + ".d", error), end; !error && it != end; it.increment(error)) {
    if (it->path().extension() == ".toml") out.push_back(it->path());
  }
  std::sort(out.begin(), out.end());
  return out;
}

Config load_what_is_right(const ConfigSources& sources) {
  try {
    return collect(sources).config;
  } catch (const std::exception&) {
    return {};
  }
}

LoadedConfig load_settings(const ConfigSources& sources, std::vector<std::string>* problems) {
  Loader loader = collect(sources);
  check_together(loader);
  const bool only_device_absent = !loader.problems.empty() && loader.absent == loader.problems.size();
  if (problems != nullptr) {
    *problems = std::move(loader.problems);
  } else if (!loader.problems.empty()) {
    ConfigError failure(loader.problems);
    failure.only_device_absent = only_device_absent;
    throw failure;
  }
  return {.config = std::move(loader.config),
          .named = {loader.named.begin(), loader.named.end()},
          .passed_over = std::move(loader.passed_over),
          .is_export = loader.is_export,
          .warnings = std::move(loader.warnings),
          .places = std::move(loader.places),
          .in_doubt = std::move(loader.in_doubt),
          .only_device_absent = only_device_absent};
}

std::string LoadedConfig::placed(const KeyProblem& problem) const {
  const auto& keys = problem.keys;
  const std::string& sentence = problem.sentence;
  if (keys.empty()) return sentence;
  auto key = std::find_if(keys.begin(), keys.end(), [&](auto k) { return places.contains(k) && sentence.find(k) != std::string::npos; });
  if (key == keys.end()) key = std::find_if(keys.begin(), keys.end(), [&](auto k) { return names_value(sentence, k, config); });
  if (key == keys.end()) key = keys.begin();
  const auto place = places.find(*key);
  if (place == places.end()) return sentence;
  return sentence.starts_with(*key) ? fmt::format("{}: {}", place->second, sentence) : fmt::format("{}: {}: {}", place->second, *key, sentence);
}

Config load_config(const ConfigSources& sources, std::vector<std::string>* warnings) {
  LoadedConfig loaded = load_settings(sources);
  if (warnings != nullptr) *warnings = std::move(loaded.warnings);
  return loaded.config;
}

void print_config(const Config& config, std::ostream& out) {
  std::string section;
  for (const ConfigKey& key : config_keys()) {
    const auto dot = key.name.rfind('.');
    const std::string table(key.name.substr(0, dot));
    if (table != section) out << (section.empty() ? "" : "\n") << "[" << table << "]\n";
    section = table;
    out << key.name.substr(dot + 1) << " = " << format_config_value(key, config) << "\n";
  }
}

void print_config_reference(std::ostream& out) {
  out << "# Configuration\n\n"
         "Generated by `boothctl config reference` from `daemon/config/keys.cpp`; a test compares the two.\n\n"
         "boothd reads `/etc/boothd/boothd.toml` (or `--config FILE`), then `FILE.d/*.toml` in alphabetical order, then each `--set key=value`; later values "
         "win.\n"
         "A table `[export]`, which `boothctl config export` writes, says who wrote the file and sets nothing.\n"
         "A file may say `version = 1` before its first table. boothd also takes a file of the next version, which an update wrote that was taken "
         "back since: there a key that it does not know is passed over with a warning ([state](state.md)).\n"
         "Mistakes are reported all at once, each with file, line, key and what is allowed. `boothd --check-config` starts nothing: it shows the "
         "result, the memory plan and then every mistake, of keys that do not go together and of what they name (models, recordings, credentials, "
         "keys to seal to), too. It ends with 78 where something must be mended, with 69 where a device or a file is only not there yet; a "
         "`gpio.chip` that is not there is a warning.\n";
  const Config defaults;
  std::string section;
  for (const ConfigKey& key : config_keys()) {
    const auto dot = key.name.rfind('.');
    const std::string table(key.name.substr(0, dot));
    if (table != section) out << "\n## [" << table << "]\n\n| key | default | allowed | meaning |\n|---|---|---|---|\n";
    section = table;
    out << "| `" << key.name.substr(dot + 1) << "` | `" << format_config_value(key, defaults) << "` | " << allowed_values(key) << " | " << key.doc;
    if (!key.absent.empty()) {
      out << " Not in this build:";
      for (const auto& value : key.absent) out << " `" << value << "`";
      out << ".";
    }
    out << " |\n";
  }
}

}  // namespace booth::daemon

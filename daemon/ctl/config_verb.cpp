// boothctl config: the page of all keys, and a whole configuration out, in, and back to the defaults.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "daemon/config/change.hpp"
#include "daemon/ctl/control_client.hpp"
#include "daemon/ctl/forget_keys.hpp"
#include "daemon/ctl/print_json.hpp"
#include "daemon/ctl/verbs.hpp"
#include "daemon/io/atomic_file.hpp"
#include "daemon/io/file_bytes.hpp"
#include "daemon/security/utc_time.hpp"

namespace booth::daemon {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kMostBytes = 1 << 20;
constexpr int kWrongConfiguration = 78;

struct Options {
  std::string config, socket, file, out, confirm;
  std::vector<std::string> assignments;
  ImportOptions import;
  bool all = false, dry_run = false, json = false;
};

/// Runs what may find mistakes in a configuration; all of them are told.
template <class F>
auto checked(F action, const char* sequel = "\nnothing was changed") {
  try {
    return action();
  } catch (const ConfigError& e) {
    throw VerbFailure(std::string(e.what()) + sequel, kWrongConfiguration);
  }
}

std::string stamp_of(const std::string& utc) {
  std::string out = utc;
  std::erase_if(out, [](char c) { return c == '-' || c == ':'; });
  return out;
}

bool boothd_runs(const std::string& socket) {
  try {
    ControlClient client{std::filesystem::path(socket)};
    return !client.ask(R"({"request":"status"})").empty();
  } catch (const std::exception&) {
    return false;
  }
}

void export_config(const Options& options) {
  const LoadedConfig settings = checked([&] { return load_settings({.file = options.config, .assignments = options.assignments}); }, "");
  const std::string text = export_text(settings, BOOTHD_VERSION, utc_text(utc_seconds()));
  if (options.out.empty() || options.out == "-")
    std::cout << text;
  else
    write_file_atomically(std::filesystem::path(options.out), text);
}

/// What is told on the way: lines for a person as they come, so that they are there when a step fails, or one object in the end.
class Account {
 public:
  explicit Account(const Options& options)
      : json_(options.json), object_{{"ok", true}, {"written", false}, {"changes", Json::array()}, {"notes", Json::array()}, {"warnings", Json::array()}} {}
  template <class... T>
  void line(fmt::format_string<T...> format, T&&... values) const {
    if (!json_) std::cout << fmt::format(format, std::forward<T>(values)...) << "\n";
  }
  void note(const std::string& text) {
    line("note: {}", text);
    object_["notes"].push_back(text);
  }
  void warn(const std::string& text) {
    line("warning: {}", text);
    object_["warnings"].push_back(text);
  }
  void change(const ConfigChange& c) {
    line("{}: {} -> {}", c.key, c.before, c.after);
    object_["changes"].push_back({{"key", c.key}, {"before", c.before}, {"after", c.after}});
  }
  Json& operator[](const char* key) { return object_[key]; }
  void close() const {
    if (json_) print_json(object_);
  }

 private:
  const bool json_;
  Json object_;
};

/// Says what changes, does it unless it is only asked about, and says what is left to do.
void carry_out(const ConfigPlan& plan, const Options& options, Account& account) {
  for (const auto& note : plan.notes) account.note(note);
  const auto changes = changes_of(plan);
  for (const auto& change : changes) account.change(change);
  for (const auto& missing : missing_files(plan.after.config)) account.warn(missing + " does not exist on this machine");
  if (changes.empty() && !plan.replaces_file) return account.line("the configuration has these values already; nothing was written");
  const char* plural = changes.size() == 1 ? "" : "s";
  if (options.dry_run) return account.line("{} value{} would change; nothing was written", changes.size(), plural);
  const std::string utc = utc_text(utc_seconds()), stamp = free_stamp(plan.file, stamp_of(utc));
  for (const auto& step : steps_of(plan, stamp, BOOTHD_VERSION, utc)) step();
  const std::string backup = fmt::format("{}.before-{}", plan.file.string(), stamp);
  account["written"] = true;
  account["backup"] = backup;
  account.line("{} value{} changed; before: {} (`boothctl config import` takes it back)", changes.size(), plural, backup);
  const bool runs = boothd_runs(options.socket.empty() ? plan.before.config.control.socket : options.socket);
  account["boothd_runs"] = runs;
  account.line("{}", runs ? "boothd runs with the old values: `systemctl restart boothd` takes the new ones; a session that runs is saved first"
                          : "boothd does not run; it takes them when it starts");
}

/// All of it, or a byte more than is accepted. A stream takes a failure for the end, and half a configuration would be taken for the whole.
std::string standard_input() {
  std::string text(kMostBytes + 1, '\0');
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t n = ::read(STDIN_FILENO, text.data() + done, text.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) throw std::runtime_error(fmt::format("cannot read standard input: {}; nothing was changed", std::strerror(errno)));
    if (n == 0) break;
    done += static_cast<std::size_t>(n);
  }
  text.resize(done);
  return text;
}

void import_config(const Options& options) {
  Account account(options);
  const bool from_input = options.file == "-";
  const std::string text = from_input ? standard_input() : read_file_bytes(options.file, kMostBytes);
  carry_out(
      checked([&] { return import_plan({.file = options.config, .assignments = {}}, text, from_input ? "standard input" : options.file, options.import); }),
      options, account);
  account.close();
}

void reset_config(const Options& options) {
  const ConfigPlan plan = checked([&] { return reset_plan({.file = options.config, .assignments = {}}, options.all); });
  const Config& before = plan.before.config;
  if (options.all && !options.dry_run && options.confirm != before.booth.id)
    throw VerbFailure(
        fmt::format("--all deletes the calibration and the credentials of this booth, which nothing brings back; `--confirm {}` means it", before.booth.id),
        64);
  Account account(options);
  carry_out(plan, options, account);
  if (!options.all) return account.close();
  const char* gone = options.dry_run ? "would_be_deleted" : "deleted";
  account[gone] = Json::array();
  for (const auto& path : key_files(before, plan.file)) {
    if (!options.dry_run) forget(path);
    account.line("{}: {}", options.dry_run ? "would be deleted" : "deleted", path.string());
    account[gone].push_back(path.string());
  }
  if (!options.dry_run)
    if (const std::string left = forget_empty_fleet(before); !left.empty()) account.warn(left);
  account.line("sessions and recordings are left as they are");
  account.close();
}

void add_places(CLI::App& verb, Options& options, bool asks_boothd) {
  verb.add_option("--config", options.config, "Configuration file; without it /etc/boothd/boothd.toml where it exists");
  if (!asks_boothd) return;
  verb.add_option("--socket", options.socket, "Control socket of boothd, to see whether it runs; without it the configuration's");
  verb.add_flag("--dry-run", options.dry_run, "Say what would change, and change nothing");
  verb.add_flag("--json", options.json, "One JSON object");
}

}  // namespace

void add_config_verb(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = app.add_subcommand("config", "The configuration: its keys, and the whole of it out, in, and back to the defaults");
  verb->require_subcommand(1);
  verb->add_subcommand("reference", "All keys with type, default and meaning, as Markdown")->callback([] { print_config_reference(std::cout); });

  CLI::App* out = verb->add_subcommand("export", "What was set, as one TOML file without secrets");
  out->add_option("--out", options->out, "The file to write; without it standard output");
  out->add_option("--set", options->assignments, "key=value, over the file's; may be given several times")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  add_places(*out, *options, false);
  out->callback([options] { export_config(*options); });

  CLI::App* in =
      verb->add_subcommand("import", "Take an exported file: checked whole, then taken in one step; what was before is kept. Status 78 when it is wrong");
  in->add_option("file", options->file, "The file; - for standard input")->required();
  in->add_flag("--keep-box", options->import.keep_box, "booth.id, sensors and calibration stay those of this box");
  in->add_flag("--known-only", options->import.known_only, "Leave out keys that this version does not know, instead of refusing the file");
  add_places(*in, *options, true);
  in->callback([options] { import_config(*options); });

  CLI::App* reset = verb->add_subcommand("reset", "Back to the defaults; name, sensors, calibration, keys and security are kept");
  reset->add_flag("--all", options->all, "Those too, and delete the files of calibration and credentials; security stays switched on. Needs --confirm");
  reset->add_option("--confirm", options->confirm, "The booth.id of this booth, for --all");
  add_places(*reset, *options, true);
  reset->callback([options] { reset_config(*options); });
}

}  // namespace booth::daemon

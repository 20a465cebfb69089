// boothctl report: one file for whoever helps from afar, with nothing of the people who stood in the booth.
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <memory>
#include <sstream>

#include "daemon/config/load.hpp"
#include "daemon/ctl/care_verbs.hpp"
#include "daemon/ctl/control_client.hpp"
#include "daemon/ctl/print_json.hpp"
#include "daemon/ctl/progress.hpp"
#include "daemon/ctl/support_bundle.hpp"
#include "daemon/drivers_factory.calibration.hpp"
#include "daemon/io/atomic_file.hpp"
#include "daemon/io/file_bytes.hpp"

namespace booth::daemon {
namespace {

struct Options {
  std::string socket, config, out;
  std::vector<std::string> assignments;
  bool json = false;
};

constexpr std::size_t kMostOutput = 8u << 20;  // bytes of one program's output
constexpr std::chrono::seconds kPatience{60};  // with one program
constexpr const char* kLeftOut = "(left out)";

std::string in_quotes(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

/// What a program says, stderr included; only for commands that are written here. On the machines that a bundle is asked of something may hang: a disk, a bus,
/// systemd itself.
std::string output_of(const std::string& command) {
  std::FILE* pipe = ::popen(fmt::format("timeout --kill-after=5 {} sh -c {} 2>&1", kPatience.count(), in_quotes(command)).c_str(), "r");
  if (pipe == nullptr) return "could not be started\n";
  std::string out;
  std::array<char, 4096> part;
  for (std::size_t n; (n = std::fread(part.data(), 1, part.size(), pipe)) > 0;)
    if (out.size() < kMostOutput) out.append(part.data(), n);
  const int status = ::pclose(pipe);
  if (WIFEXITED(status) && (WEXITSTATUS(status) == 124 || WEXITSTATUS(status) == 137)) out += fmt::format("\n(did not end within {} s)\n", kPatience.count());
  return without_session_names(out);
}

/// This very program, with the options that say which configuration is meant.
std::string doctor_command(const Options& options) {
  std::array<char, 4096> self{};
  const ssize_t n = ::readlink("/proc/self/exe", self.data(), self.size() - 1);
  std::string command = in_quotes(n > 0 ? std::string(self.data(), static_cast<std::size_t>(n)) : "boothctl") + " doctor --json";
  if (!options.config.empty()) command += " --config " + in_quotes(options.config);
  for (const auto& assignment : options.assignments) command += " --set " + in_quotes(assignment);
  return command;
}

std::string status_text(const Config& config, const Options& options) {
  try {
    ControlClient client(control_socket_path(options.socket.empty() ? config.control.socket : options.socket));
    return status_for_report(StatusJson::parse(client.ask(R"({"request":"status"})"), nullptr, false));
  } catch (const std::exception& e) {
    return without_session_names(e.what()) + "\n";
  }
}

/// What leads to a person, to keys or to other machines; none of the files says it.
std::vector<std::string> secrets_of(const Config& config) {
  std::vector<std::string> out = config.dds.peers;
  for (const std::string* text : {&config.cameras.recording.path, &config.privacy.seal_to, &config.dds.credentials}) out.push_back(*text);
  if (config.dds.self_issued != Config{}.dds.self_issued) out.push_back(config.dds.self_issued);
  std::sort(out.begin(), out.end(), [](const std::string& a, const std::string& b) { return a.size() > b.size(); });  // the whole before its parts
  return out;
}

std::string config_text(Config config) {
  for (std::string* text : {&config.cameras.recording.path, &config.privacy.seal_to, &config.dds.credentials})
    if (!text->empty()) *text = kLeftOut;
  for (auto& peer : config.dds.peers) peer = kLeftOut;
  std::ostringstream out;
  print_config(config, out);
  return without_session_names(out.str());
}

bool reads_as_calibration(const std::string& text) {
  try {
    return !read_cameras(text, "calibration").empty();
  } catch (const std::exception&) {
    return false;
  }
}

std::string calibration_text(const Config& config) {
  if (config.cameras.kinect2.calibration.empty()) return "none is configured (cameras.kinect2.calibration)\n";
  try {
    const std::string text = read_file_bytes(config.cameras.kinect2.calibration, 1u << 20);
    // boothd may write there, and root is asked for the bundle: a link in this place could lead to any file, and its text stays where it is.
    if (!reads_as_calibration(text)) return "left out, as it is no calibration; doctor.txt says why\n";
    return without_session_names(text);
  } catch (const std::exception& e) {
    return without_session_names(e.what()) + "\n";
  }
}

void run(const Options& options) {
  ConfigSources sources;
  sources.file = options.config;
  sources.assignments = options.assignments;
  std::string problems = "none\n";
  Config config;
  try {
    config = load_config(sources);
  } catch (const std::exception& e) {
    problems = without_session_names(e.what()) + "\n";
    config = load_what_is_right(sources);
  }
  say_step("asking boothd, doctor, systemd and the journal");
  std::vector<BundleFile> files{
      {"version.txt", "version of boothctl, of the kernel and of Debian", "boothctl " BOOTHD_VERSION "\n" + output_of("uname -srvm; cat /etc/debian_version")},
      {"config.toml", "the resolved configuration, without addresses of peers and where keys and recordings lie", config_text(config)},
      {"config-problems.txt", "what is wrong with it", problems},
      {"status.txt", "what boothd says of itself, without the session and the person", status_text(config, options)},
      {"doctor.txt", "boothctl doctor: controllers, sensors, clock, disk, DDS, buttons", output_of(doctor_command(options))},
      {"calibration.txt", "positions of the cameras with the error that was measured", calibration_text(config)},
      {"units.txt", "systemctl status of boothd's units",
       output_of("systemctl --no-pager --lines=0 status boothd.service boothd-failed.service boothd.slice 'boothd-usb-recover@*'")},
      {"journal.txt", "the last 5000 lines of boothd and its units, names of sessions and addresses left out",
       output_of("journalctl --no-pager --output=short-iso --no-hostname --lines=5000 -u boothd -u boothd-failed -u 'boothd-usb-recover@*'")}};
  for (BundleFile& f : files) f.bytes = without_addresses(without_values(f.bytes, secrets_of(config)));
  write_file_atomically(std::filesystem::path(options.out), bundle_archive(files, std::time(nullptr)), 0600);
  if (options.json) {
    nlohmann::ordered_json j{{"ok", true}, {"file", options.out}, {"files", nlohmann::ordered_json::array()}};
    for (const BundleFile& f : files) j["files"].push_back({{"name", f.name}, {"bytes", f.bytes.size()}, {"what", f.what}});
    return print_json(j);
  }
  for (const BundleFile& f : files) std::cout << fmt::format("{:<20} {:>8} bytes  {}\n", f.name, f.bytes.size(), f.what);
  std::cout << options.out << ": look into it before you hand it on\n";
}

}  // namespace

void add_report_verb(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = app.add_subcommand("report", "Write a support bundle: version, configuration, status, doctor, calibration, journal; nothing of sessions");
  verb->add_option("--out", options->out, "The archive (tar) to write, readable by its owner only")->required();
  verb->add_option("--socket", options->socket, "Control socket of boothd; without it the configuration's");
  verb->add_option("--config", options->config, "Configuration file; without it /etc/boothd/boothd.toml where it exists");
  verb->add_option("--set", options->assignments, "key=value, over the file's; may be given several times")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  verb->add_flag("--json", options->json, "One JSON object");
  verb->callback([options] { run(*options); });
}

}  // namespace booth::daemon

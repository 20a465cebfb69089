// boothctl fleet: every booth of the network and how it is; a monitor's exit status.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "daemon/ctl/fleet_report.hpp"
#include "daemon/ctl/network_options.hpp"
#include "daemon/ctl/verbs.hpp"

namespace booth::daemon {
namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  NetworkOptions network;
  std::vector<std::string> expected;
  double seconds = 4;
  bool json = false, watch = false;
};

void print(const std::vector<FleetRow>& rows, bool json) { std::cout << (json ? fleet_json(rows) + "\n" : fleet_table(rows)) << std::flush; }

void run(const Options& options) {
  BoothListener listener(network_settings(options.network, "*"));
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options.seconds));
  while (Clock::now() < end) {
    listener.poll(std::chrono::milliseconds(100));
    const bool complete = !options.expected.empty() && std::all_of(options.expected.begin(), options.expected.end(), [&](const std::string& id) {
      const auto it = listener.booths().find(id);
      return it != listener.booths().end() && it->second.status_known && it->second.skeleton_known;
    });
    if (complete && !options.watch) break;
  }
  if (options.watch) {
    const bool terminal = ::isatty(STDOUT_FILENO);
    for (auto next = Clock::now(); std::cout.good(); next += std::chrono::seconds(1)) {
      while (Clock::now() < next) listener.poll(std::chrono::milliseconds(100));
      if (terminal && !options.json) std::cout << "\033[H\033[2J";
      print(fleet_rows(listener.booths(), options.expected), options.json);
    }
    return;
  }
  const auto rows = fleet_rows(listener.booths(), options.expected);
  print(rows, options.json);
  if (listener.left_out() > 0) throw VerbFailure(fmt::format("more than {} names of booths on this network; the rest is left out", BoothListener::kMostBooths));
  if (rows.empty()) throw VerbFailure("no booth was heard; look at the keys dds.domain, dds.interface, dds.multicast and dds.peers (--set)");
  if (const int n = unwell(rows); n > 0) throw VerbFailure(fmt::format("{} of {} booths {} unwell", n, rows.size(), n == 1 ? "is" : "are"));
}

}  // namespace

void add_fleet_verb(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb =
      app.add_subcommand("fleet", "All booths of the network: state, cameras, frames/s, residual, calibration, disk, faults. Exit status 1 when one is unwell");
  add_network_options(*verb, options->network);
  verb->add_option("--expect", options->expected, "Names of booths that must be there; ends as soon as all were heard")->delimiter(',');
  verb->add_option("--seconds", options->seconds, "How long to listen")->check(CLI::Range(0.1, 3600.0))->capture_default_str();
  verb->add_flag("--json", options->json, "One JSON object");
  verb->add_flag("--watch", options->watch, "Again every second, until interrupted");
  verb->callback([options] { run(*options); });
}

}  // namespace booth::daemon

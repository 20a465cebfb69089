// boothctl watch: live skeletons in a terminal, or plain lines in a pipe; of this machine's boothd, or of booths on the network.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cmath>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "daemon/ctl/control_client.hpp"
#include "daemon/ctl/network_options.hpp"
#include "daemon/ctl/stick_figure.hpp"
#include "daemon/ctl/verbs.hpp"
#include "daemon/ctl/watch_network.hpp"
#include "fit/body/skeleton.hpp"

namespace booth::daemon {
namespace {

using Json = nlohmann::json;
using Joints = std::array<std::array<double, 3>, 24>;

struct Options {
  std::string socket, booth;
  NetworkOptions network;
  double seconds = 0;
  bool json = false;
};

std::string summary(const Json& s, double elapsed) {
  std::string line = fmt::format("{:5.1f} s  {:<10}", elapsed, s.value("state", "?"));
  if (!s.value("known", false)) return line;
  return line + fmt::format(" {:<9} frame {:>5}  {:4.1f} frames/s  latency {:3.0f} ms  residual {:4.1f} mm  {} groups dropped", s.value("person", ""),
                            s.value("frame", 0), s.value("fps", 0.0), s.value("latency_p50_ms", 0.0), 1e3 * s.value("residual", 0.0),
                            s.value("groups_dropped", 0));
}

std::string joints_line(const Joints& j) {
  const auto at = [&](int i) {
    return fmt::format("({:5.2f} {:5.2f} {:5.2f})", j[static_cast<std::size_t>(i)][0], j[static_cast<std::size_t>(i)][1], j[static_cast<std::size_t>(i)][2]);
  };
  return fmt::format("  root {}  head {}  left hand {}  right hand {}", at(0), at(fit::joint_index("head_top")), at(fit::joint_index("lwrist")),
                     at(fit::joint_index("rwrist")));
}

void run(const Options& options) {
  if (!options.booth.empty())
    return watch_network({.settings = network_settings(options.network, options.booth), .seconds = options.seconds, .json = options.json});
  if (options.json) throw VerbFailure("--json goes with the name of a booth on the network, or '*'", 64);
  ControlClient client(control_socket_path(options.socket));
  const bool terminal = ::isatty(STDOUT_FILENO);
  const auto begin = std::chrono::steady_clock::now();
  const auto pause = terminal ? std::chrono::milliseconds(100) : std::chrono::milliseconds(1000);
  for (auto next = begin; std::cout.good(); next += pause) {
    std::this_thread::sleep_until(next);
    const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (options.seconds > 0 && elapsed > options.seconds) return;
    const Json s = Json::parse(client.ask(R"({"request":"skeleton"})"), nullptr, false);
    if (!s.is_object() || !s.value("ok", false)) throw VerbFailure("boothd gave an answer that is not understood");
    const bool known = s.value("known", false) && s.value("person", "") != "lost";
    // NaN travels as null: such a joint is not drawn.
    Joints joints{};
    for (std::size_t j = 0; known && j < joints.size(); ++j) {
      for (std::size_t a = 0; a < 3; ++a) joints[j][a] = s["joints"][j][a].is_number() ? s["joints"][j][a].get<double>() : std::nan("");
    }
    if (terminal) {
      constexpr int kColumns = 76, kRows = 32;
      std::cout << "\033[H\033[2J" << summary(s, elapsed) << "\n";
      if (known) std::cout << joints_line(joints) << "\n\n" << stick_figure(joints, kColumns, kRows);
      std::cout << std::flush;
    } else {
      std::cout << summary(s, elapsed) << (known ? joints_line(joints) : "") << std::endl;
    }
  }
}

}  // namespace

void add_watch_verb(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = app.add_subcommand("watch", "The live skeleton: a figure on a terminal, lines in a pipe (booth frame, metres)");
  verb->add_option("booth", options->booth, "A booth on the network, or '*' for all of them; without it the boothd of this machine");
  add_network_options(*verb, options->network);
  verb->add_flag("--json", options->json, "With a booth: one JSON object for each skeleton");
  verb->add_option("--socket", options->socket, "Control socket of boothd; without it the configuration's");
  verb->add_option("--seconds", options->seconds, "End after so many seconds; 0: when interrupted")->check(CLI::Range(0.0, 86400.0));
  verb->callback([options] { run(*options); });
}

}  // namespace booth::daemon

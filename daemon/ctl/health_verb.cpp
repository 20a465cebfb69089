// boothctl health: one exit status for whoever has just updated a booth and must decide whether to go back.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <memory>
#include <optional>
#include <thread>

#include "daemon/ctl/care_verbs.hpp"
#include "daemon/ctl/control_client.hpp"
#include "daemon/ctl/health_gate.hpp"
#include "daemon/ctl/progress.hpp"
#include "daemon/ctl/verbs.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

struct Options {
  std::string socket;
  bool gate = false, every_camera = false, json = false;
  std::optional<std::uint64_t> frames;
  std::optional<double> wait;
};

/// The connection is kept, so that a boothd that was started anew in between is noticed.
class Visit {
 public:
  Visit(std::filesystem::path socket, HealthGate& gate) : socket_(std::move(socket)), gate_(gate) {}
  HealthVerdict look(std::chrono::milliseconds limit) {
    try {
      if (!client_) client_.emplace(socket_);
      return gate_.look(StatusJson::parse(client_->ask(R"({"request":"status"})", limit), nullptr, false));
    } catch (const std::exception& e) {
      client_.reset();
      gate_.forget();
      return {false, e.what()};
    }
  }

 private:
  const std::filesystem::path socket_;
  HealthGate& gate_;
  std::optional<ControlClient> client_;
};

void print(const Options& options, const HealthGate& gate, const HealthVerdict& verdict, std::uint64_t frames, double seconds) {
  if (!options.json) {
    if (verdict.healthy) std::cout << verdict.sentence << "\n";
    return;
  }
  StatusJson j{{"healthy", verdict.healthy}, {"sentence", verdict.sentence}, {"seconds", std::round(seconds * 10) / 10}, {"frames_wanted", frames}};
  j["cameras"] = StatusJson::array();
  for (const auto& c : gate.cameras()) j["cameras"].push_back({{"name", c.name}, {"state", c.state}, {"frames", c.frames}});
  std::cout << j.dump(-1, ' ', false, StatusJson::error_handler_t::replace) << "\n";
}

void run(const Options& options) {
  const std::uint64_t frames = options.frames.value_or(options.gate ? 30 : 0);
  const double wait = options.wait.value_or(options.gate || frames > 0 ? 60 : 0);
  HealthGate gate({frames, options.every_camera, options.gate ? "boothd " BOOTHD_VERSION : ""});
  Visit visit(control_socket_path(options.socket), gate);
  const auto began = Clock::now();
  const auto deadline = began + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(wait));
  HealthVerdict verdict;
  ProgressLine line;
  while (true) {
    // A boothd that starts listens already but answers only when it is ready.
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now());
    verdict = visit.look(std::clamp<std::chrono::milliseconds>(left, 2s, 10s));
    if (verdict.healthy || Clock::now() >= deadline) break;
    line.show(fmt::format("waiting {:3} of {} s: {}", std::chrono::duration_cast<std::chrono::seconds>(Clock::now() - began).count(), wait, verdict.sentence));
    std::this_thread::sleep_for(100ms);
  }
  line.clear();
  print(options, gate, verdict, frames, std::chrono::duration<double>(Clock::now() - began).count());
  std::cout.flush();
  if (!verdict.healthy) throw VerbFailure("not healthy: " + verdict.sentence);
}

}  // namespace

void add_health_verb(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = app.add_subcommand("health", "Exit status 0 only when boothd is ready, raises no alarm and enough cameras deliver");
  verb->add_option("--socket", options->socket, "Control socket of boothd; without it the configuration's");
  verb->add_flag("--gate", options->gate, "After an update: as --frames 30 --wait 60, and the boothd that answers is of this program's version");
  verb->add_option("--frames", options->frames, "Frames that every camera in service has to deliver from now on; 0: only look")
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{1'000'000}));
  verb->add_option("--wait", options->wait, "Most seconds in which all of that has to become true")->check(CLI::Range(0.0, 86400.0));
  verb->add_flag("--every-camera", options->every_camera, "No camera may be missing; otherwise cameras.minimum of them are enough");
  verb->add_flag("--json", options->json, "One JSON object");
  verb->callback([options] { run(*options); });
}

}  // namespace booth::daemon

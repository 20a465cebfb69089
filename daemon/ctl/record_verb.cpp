// boothctl record and snapshot: boothd writes, boothctl watches over it and says where the files are.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "daemon/ctl/control_client.hpp"
#include "daemon/ctl/progress.hpp"
#include "daemon/ctl/verbs.hpp"

namespace booth::daemon {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string socket;
  bool depth = false, uncompressed = false, json = false;
  double seconds = 0;
};

volatile std::sig_atomic_t interrupted = 0;

Json ask(ControlClient& client, const Json& request) {
  Json answer = Json::parse(client.ask(request.dump()), nullptr, false);
  if (!answer.is_object()) throw VerbFailure("boothd gave an answer that is not understood; is it of the same version?");
  if (!answer.value("ok", false)) throw VerbFailure(answer.value("error", std::string("boothd refused without a reason")));
  return answer;
}

/// Until boothd says that the files are whole. Ctrl-C ends the recording, and then its files are waited for all the same; a second one goes at once.
Json wait_for(ControlClient& client, const char* which, bool stoppable) {
  bool stopping = false;
  ProgressLine line;
  while (true) {
    Json r = ask(client, {{"request", "record_status"}})[which];
    if (!r.value("running", false)) return r;
    line.show(fmt::format("{} {:6.1f} s  {:6} frames  {:8.1f} MB", which, r.value("seconds", 0.0), r.value("frames", 0), 1e-6 * r.value("bytes", 0.0)));
    if (interrupted > 1) throw VerbFailure(fmt::format("not waited for; boothd goes on to finish {}", r.value("path", std::string())), 130);
    if (interrupted && stoppable && !stopping) {
      stopping = true;
      ask(client, {{"request", "record_stop"}});
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(interrupted ? 50 : 250));
  }
}

void report(const Json& r, const Options& options) {
  if (options.json) {
    std::cout << r.dump() << "\n";
  } else {
    std::cout << fmt::format("{}\n", r.value("path", std::string()));
    std::cerr << fmt::format("{:.1f} s, {} depth frames, {:.1f} MB{}\n", r.value("seconds", 0.0), r.value("frames", 0), 1e-6 * r.value("bytes", 0.0),
                             r.value("depth", false) ? "" : "; without depth: events and skeletons only");
    if (r.value("missed", 0) > 0) std::cerr << fmt::format("warning: {} moments came faster than the disk took them and are missing\n", r.value("missed", 0));
  }
  if (const std::string problem = r.value("problem", std::string()); !problem.empty()) throw VerbFailure(problem);
}

void catch_interrupts() {
  const auto handler = [](int) { interrupted = interrupted + 1; };
  std::signal(SIGINT, handler);
  std::signal(SIGTERM, handler);
}

void record(const Options& options) {
  ControlClient client(control_socket_path(options.socket));
  catch_interrupts();
  Json request{{"request", "record"}, {"depth", options.depth}, {"uncompressed", options.uncompressed}};
  if (options.seconds > 0) request["seconds"] = options.seconds;
  ask(client, request);
  report(wait_for(client, "recording", true), options);
}

void snapshot(const Options& options) {
  ControlClient client(control_socket_path(options.socket));
  catch_interrupts();
  ask(client, {{"request", "snapshot"}});
  report(wait_for(client, "snapshot", false), options);
}

}  // namespace

void add_record_verbs(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb =
      app.add_subcommand("record", "Write what passes from now on into a rosbag2, until ctrl-C: events and skeletons, and with --depth the depth images");
  verb->add_flag("--depth", options->depth, "Depth images of all cameras, too; needs record.depth = true in boothd's configuration");
  verb->add_option("--seconds", options->seconds, "End by itself after so long")->check(CLI::Range(0.1, 86400.0));
  verb->add_flag("--uncompressed", options->uncompressed, "sensor_msgs/Image instead of CompressedImage: twice the size, for tools that know no RVL");
  verb->add_flag("--json", options->json, "One JSON object instead of the path");
  verb->add_option("--socket", options->socket, "boothd's control socket");
  verb->callback([options] { record(*options); });

  auto snap = std::make_shared<Options>();
  verb = app.add_subcommand("snapshot", "Write the last half minute, which boothd always has in memory, into a rosbag2");
  verb->add_flag("--json", snap->json, "One JSON object instead of the path");
  verb->add_option("--socket", snap->socket, "boothd's control socket");
  verb->callback([snap] { snapshot(*snap); });
}

}  // namespace booth::daemon

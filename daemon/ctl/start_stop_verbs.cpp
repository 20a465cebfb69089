// boothctl start and stop: the button, from a keyboard.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "daemon/ctl/control_client.hpp"
#include "daemon/ctl/progress.hpp"
#include "daemon/ctl/verbs.hpp"

namespace booth::daemon {
namespace {

using Json = nlohmann::json;

struct Options {
  std::string socket;
  bool wait = false, json = false;
  double limit = 120;
};

Json ask(ControlClient& client, const char* request) {
  Json answer = Json::parse(client.ask(Json{{"request", request}}.dump()), nullptr, false);
  if (!answer.is_object()) throw VerbFailure("boothd gave an answer that is not JSON");
  return answer;
}

/// Asks for the status until `there` says so.
template <class F>
Json wait_for(ControlClient& client, double limit, const char* what, F there) {
  const auto begin = std::chrono::steady_clock::now();
  const auto deadline = begin + std::chrono::duration<double>(limit);
  ProgressLine line;
  while (true) {
    Json status = ask(client, "status");
    if (there(status.value("state", ""))) return status;
    if (std::chrono::steady_clock::now() > deadline)
      throw VerbFailure(fmt::format("{} took longer than {} s; boothd is {}{}", what, limit, status.value("state", "?"),
                                    status.value("remark", "").empty() ? "" : ": " + status.value("remark", "")));
    line.show(fmt::format("{}: {:3} s  {}{}", what, std::chrono::duration_cast<std::chrono::seconds>(std::chrono::steady_clock::now() - begin).count(),
                          status.value("state", "?"), status.value("remark", "").empty() ? "" : ", " + status.value("remark", "")));
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

/// What a session came to, from its session.json.
std::string summary(const Json& status) {
  const Json j = status.value("last_session", Json::object());
  if (j.empty() || j.value("id", "") != status.value("session", "?")) return {};
  std::string out = fmt::format("frames     {} fitted at {:.1f} frames/s, {} groups dropped, nobody seen in {}\n", j.value("frames", 0), j.value("fps", 0.0),
                                j.value("groups_dropped", 0), j.value("frames_lost", 0));
  if (j.contains("latency_ms"))
    out += fmt::format("latency    {:.0f} ms from the cameras to DDS (95 %: {:.0f} ms, longest {:.0f} ms)\n", j["latency_ms"].value("p50", 0.0),
                       j["latency_ms"].value("p95", 0.0), j["latency_ms"].value("max", 0.0));
  if (j.contains("residual"))
    out += fmt::format("residual   {:.1f} mm from the measured points to the fitted surface\n", 1e3 * j["residual"].value("mean", 0.0));
  if (j.contains("truth")) {
    const Json& t = j["truth"];
    out += fmt::format("truth      joints off by {:.1f} mm on average (95 %: {:.1f} mm), of 15 joints in {} frames", 1e3 * t.value("joint_mean", 0.0),
                       1e3 * t.value("joint_p95", 0.0), t.value("frames", 0));
    if (t.contains("surface_mean")) out += fmt::format("; surface by {:.1f} mm", 1e3 * t.value("surface_mean", 0.0));
    out += "\n";
  }
  return out;
}

void run(const Options& options, const char* request) {
  ControlClient client(control_socket_path(options.socket));
  const bool starting = std::string(request) == "start";
  const Json answer = ask(client, request);
  if (!answer.value("ok", false)) throw VerbFailure(answer.value("error", "refused"));
  Json status;
  if (options.wait) {
    status = starting ? wait_for(client, options.limit, "finding a body", [](const std::string& s) { return s == "tracking" || s == "idle"; })
                      : wait_for(client, options.limit, "saving the session", [](const std::string& s) { return s == "idle"; });
    if (starting && status.value("state", "") == "idle") throw VerbFailure("the session ended before a body was found");
  } else {
    status = ask(client, "status");
  }
  if (options.json) {
    std::cout << status.dump() << "\n";
  } else {
    if (!starting && options.wait) std::cout << summary(status);
    std::cout << status.value("state", "?") << (status.value("session_folder", "").empty() ? "" : "  " + status.value("session_folder", "")) << "\n";
  }
  const std::string alarm = status.value("alarm", ""), session = status.value("session", "");
  std::cout.flush();
  if (!starting && options.wait && !session.empty() && status.value("last_session", Json::object()).value("id", "") != session)
    throw VerbFailure(fmt::format("session {} is not saved{}{}", session, alarm.empty() ? "" : ": ", alarm));
  if (!alarm.empty()) std::cerr << "warning: " << alarm << "\n";
}

void add(CLI::App& app, const char* name, const char* help, const char* wait_help) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = app.add_subcommand(name, help);
  verb->add_option("--socket", options->socket, "Control socket of boothd; without it the configuration's");
  verb->add_flag("--wait", options->wait, wait_help);
  verb->add_option("--limit", options->limit, "Most seconds to wait")->check(CLI::Range(0.1, 86400.0))->capture_default_str();
  verb->add_flag("--json", options->json, "Print the status afterwards as JSON");
  verb->callback([options, name] { run(*options, name); });
}

}  // namespace

void add_start_stop_verbs(CLI::App& app) {
  add(app, "start", "Begin a session", "Wait until a body has been found and is tracked");
  add(app, "stop", "End the session", "Wait until the session's files are written");
}

}  // namespace booth::daemon

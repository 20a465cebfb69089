// boothctl status: what boothd says of itself, for people or as JSON.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "daemon/ctl/control_client.hpp"
#include "daemon/ctl/status_reading.hpp"
#include "daemon/ctl/verbs.hpp"
#include "daemon/drivers_factory.usb.hpp"

namespace booth::daemon {
namespace {

struct Options {
  std::string socket;
  bool json = false, watch = false;
};

using Json = nlohmann::ordered_json;

/// Adds `port` and `controller` where a camera's serial is plugged into this machine.
void add_places(Json& status) {
  if (!status.contains("cameras") || !status["cameras"].is_array() || status["cameras"].empty()) return;
  const auto usb = open_usb_topology()->read();
  for (Json& camera : status["cameras"])
    for (const auto& d : usb.devices)
      if (camera.is_object() && is_sensor(d) && !d.serial.empty() && camera.value("serial", "") == d.serial) {
        camera["port"] = d.path;
        camera["controller"] = d.controller;
      }
}

std::string camera_state(const std::string& state) { return state == "running" ? "delivering" : state == "lost" ? "recovering" : state; }

std::string age(double seconds) {
  constexpr double kHour = 3600, kDay = 24 * kHour;
  return seconds < kHour      ? "less than an hour ago"
         : seconds < 2 * kDay ? fmt::format("{:.0f} hours ago", seconds / kHour)
                              : fmt::format("{:.0f} days ago", seconds / kDay);
}

/// What the cameras' places and the sessions' disk are worth.
std::string calibration_and_disk(const Json& s) {
  const bool dated = has_number(s, "calibration_age_s"), measured = has_number(s, "calibration_residual");
  std::string out = "calibrated " + (dated ? age(number_in(s, "calibration_age_s")) : "not known when");
  out += measured ? fmt::format(", residual {:.1f} mm\n", 1e3 * number_in(s, "calibration_residual")) : ", residual not known\n";
  out += !has_number(s, "disk_free_bytes") ? "disk       not known\n"
                                           : fmt::format("disk       {:.1f} of {:.1f} GB free where sessions are kept\n", number_in(s, "disk_free_bytes") / 1e9,
                                                         number_in(s, "disk_total_bytes") / 1e9);
  return out;
}

std::string for_people(const Json& s) {
  std::string out =
      fmt::format("state      {}{}{}{}\n", s.value("state", "?"), s.value("paused", false) ? ", paused: too few cameras" : "",
                  s.value("degraded", false) ? ", degraded: a camera is missing" : "", s.value("emergency_latched", false) ? ", emergency stop pressed" : "");
  if (const std::string alarm = s.value("alarm", ""); !alarm.empty()) out += "alarm      " + alarm + "\n";
  if (s.value("countdown_seconds", 0) > 0) out += fmt::format("countdown  {} s\n", s.value("countdown_seconds", 0));
  if (const Json c = s.value("calibration", Json::object()); c.value("begun", 0) > 0)
    out += c.value("running", false) ? fmt::format("calibrate  {} views, {}; {}\n", c.value("views", 0), c.value("cue", ""), c.value("next", ""))
                                     : fmt::format("calibrate  {}: {}\n", c.value("outcome", ""), c.value("sentence", ""));
  if (const Json panel = s.value("panel", Json::object()); panel.value("present", false)) {
    out +=
        fmt::format("light      {}{}{}\n", panel.value("light", "?"), panel.value("fault_code", 0) > 0 ? fmt::format(" {}", panel.value("fault_code", 0)) : "",
                    panel.value("flicker", false) ? ", flickering" : "");
    for (const auto& problem : panel.value("problems", Json::array()))
      if (problem.is_string()) out += "panel      " + problem.get<std::string>() + "\n";
  }
  if (s.contains("backend") && s["backend"].is_object())
    if (const std::string problem = s["backend"].value("problem", ""); !problem.empty())
      out += "backend    " + s["backend"].value("name", "") + ": " + problem + "\n";
  if (const std::string security = s.value("dds_security", ""); !security.empty()) out += "security   " + security + "\n";
  if (const std::string problem = s.value("credential_problem", ""); !problem.empty() && problem != s.value("alarm", "")) out += "security   " + problem + "\n";
  if (const std::string remark = s.value("remark", ""); !remark.empty()) out += "remark     " + remark + "\n";
  for (const Json& c : s.value("cameras", Json::array())) {
    out += fmt::format("camera     {:<14} {:<10} {:>5.1f} frames/s, {} dropped, {} restarts{}{}{}\n", c.value("name", "?"), camera_state(c.value("state", "?")),
                       c.value("fps", 0.0), c.value("dropped", 0), c.value("restarts", 0),
                       c.value("serial", "").empty() ? "" : ", serial " + c.value("serial", ""),
                       c.value("port", "").empty() ? "" : fmt::format(", port {} of {}", c.value("port", ""), c.value("controller", "?")),
                       c.value("problem", "").empty() ? "" : ": " + c.value("problem", ""));
    if (const Json decoder = c.value("decoder", Json::object()); decoder.is_object() && !decoder.value("problem", "").empty())
      out += fmt::format("           {:<14} decoded by {}: {}\n", "", decoder.value("name", "?"), decoder.value("problem", ""));
    const Json drift = c.value("drift", Json::object());
    const std::string verdict = drift.is_object() ? drift.value("verdict", "") : "";
    if (verdict == "moved")
      out += fmt::format("           {:<14} HAS MOVED: its points of a person are {:.0f} mm off\n", "", drift.value("displacement_mm", 0.0));
    if (verdict == "blind") out += fmt::format("           {:<14} SEES NOBODY where the other cameras do\n", "");
  }
  if (s.value("frames", 0) > 0) {
    const Json latency = s.value("latency_ms", Json::object());
    out += fmt::format("fit        {} frames, {:.1f} frames/s, latency {:.0f} ms (99 %: {:.0f} ms), {} groups dropped", s.value("frames", 0),
                       s.value("fps", 0.0), latency.value("p50", 0.0), latency.value("p99", 0.0), s.value("groups_dropped", 0));
    if (s.contains("residual")) out += fmt::format(", residual {:.1f} mm", 1e3 * s.value("residual", 0.0));
    out += "\n";
  }
  out += calibration_and_disk(s);
  if (const std::string folder = s.value("session_folder", ""); !folder.empty()) out += "session    " + folder + "\n";
  return out;
}

void run(const Options& options) {
  ControlClient client(control_socket_path(options.socket));
  const bool terminal = ::isatty(STDOUT_FILENO);
  while (true) {
    const std::string line = client.ask(R"({"request":"status"})");
    Json status = Json::parse(line, nullptr, false);
    if (!status.is_object()) throw VerbFailure("boothd gave an answer that is not JSON");
    add_places(status);
    if (options.json) {
      std::cout << status.dump(-1, ' ', false, Json::error_handler_t::replace) << std::endl;
    } else {
      if (options.watch && terminal) std::cout << "\033[H\033[2J";
      std::cout << for_people(status) << std::flush;
    }
    if (!options.watch || !std::cout) return;  // nobody reads it any more: SIGPIPE does not end this program
    std::this_thread::sleep_for(std::chrono::seconds(1));
  }
}

}  // namespace

void add_status_verb(CLI::App& app) {
  auto options = std::make_shared<Options>();
  CLI::App* verb = app.add_subcommand("status", "What boothd is doing: state, cameras, fit, session");
  verb->add_option("--socket", options->socket, "Control socket of boothd; without it the configuration's");
  verb->add_flag("--json", options->json, "One JSON object a line");
  verb->add_flag("--watch", options->watch, "Again every second, until interrupted");
  verb->callback([options] { run(*options); });
}

}  // namespace booth::daemon

// JSON in, JSON out.
#include "daemon/ctl/control_protocol.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace booth::daemon {
namespace {

using Json = nlohmann::ordered_json;

Json latency_json(const LatencySummary& l) {
  return {{"count", l.count}, {"p50", l.p50_ms}, {"p95", l.p95_ms}, {"p99", l.p99_ms}, {"max", l.max_ms}, {"mean", l.mean_ms}};
}

const char* light_name(hal::LightPattern pattern) {
  switch (pattern) {
    case hal::LightPattern::off:
      return "off";
    case hal::LightPattern::idle_steady:
      return "steady";
    case hal::LightPattern::countdown_double_blink:
      return "double blink";
    case hal::LightPattern::estimating_fast_blink:
      return "fast blink";
    case hal::LightPattern::tracking_on:
      return "on";
    case hal::LightPattern::searching_slow_blink:
      return "slow blink";
    case hal::LightPattern::saving_flash:
      return "flash";
    case hal::LightPattern::fault_code:
      return "fault";
  }
  return "?";
}

Json panel_json(const PanelStatus& panel) {
  if (!panel.present) return {{"present", false}};
  return {{"present", true},
          {"light", light_name(panel.light.pattern)},
          {"fault_code", panel.light.code},
          {"flicker", panel.light.degraded},
          {"problems", panel.problems}};
}

const char* verdict_name(CameraDriftStatus::Verdict verdict) {
  switch (verdict) {
    case CameraDriftStatus::Verdict::unknown:
      return "unknown";
    case CameraDriftStatus::Verdict::stands:
      return "stands";
    case CameraDriftStatus::Verdict::moved:
      return "moved";
    case CameraDriftStatus::Verdict::blind:
      return "blind";
  }
  return "?";
}

/// Figures only where there are any.
Json drift_json(const CameraDriftStatus& d) {
  const auto rounded = [](double value) { return std::round(value * 100) / 100; };
  Json j{{"verdict", verdict_name(d.verdict)}};
  if (d.deviation > 0) {
    j["displacement_mm"] = rounded(1e3 * d.displacement);
    j["deviation_mm"] = rounded(1e3 * d.deviation);
    j["turn_deg"] = rounded(d.turn * 180 / 3.14159265358979);
    j["shift_mm"] = rounded(1e3 * d.shift);
  }
  if (d.late_known) {
    j["late_ms"] = rounded(1e3 * d.late);
    j["late_deviation_ms"] = rounded(1e3 * d.late_deviation);
  }
  return j;
}

Json calibration_json(const CalibrationStatus& c) {
  return {{"running", c.running}, {"begun", c.begun}, {"cue", to_string(c.cue)},         {"views", c.views},
          {"seen", c.seen},       {"next", c.next},   {"outcome", to_string(c.outcome)}, {"sentence", c.sentence},
          {"restart", c.restart}};
}

Json make_status(const DaemonStatus& s) {
  Json j;
  j["ok"] = true;
  j["software"] = s.software;
  j["state"] = to_string(s.state);
  j["degraded"] = s.degraded;
  j["paused"] = s.paused;
  j["emergency_latched"] = s.latched;
  j["countdown_seconds"] = s.countdown_seconds;
  j["panel"] = panel_json(s.panel);
  j["alarm"] = s.alarm;
  j["session"] = s.session;
  j["session_folder"] = s.session_folder;
  j["cameras"] = Json::array();
  for (const CameraStatus& c : s.cameras) {
    j["cameras"].push_back({{"name", c.name},
                            {"serial", c.serial},
                            {"state", to_string(c.state)},
                            {"fps", std::round(c.fps * 10) / 10},
                            {"delivered", c.counters.delivered},
                            {"dropped", c.counters.dropped + c.no_slot},
                            {"corrupt", c.counters.corrupt},
                            {"restarts", c.restarts},
                            {"problem", c.problem}});
    if (const hal::DecodeStatus& d = c.decoding; !d.name.empty())
      j["cameras"].back()["decoder"] = {{"name", d.name}, {"problem", d.problem}, {"losses", d.losses}, {"changes", d.changes}};
    if (const std::size_t i = j["cameras"].size() - 1; i < s.drift.size()) j["cameras"].back()["drift"] = drift_json(s.drift[i]);
  }
  j["cameras_minimum"] = s.minimum_cameras;
  j["groups"] = s.counters.groups;
  j["groups_dropped"] = s.counters.groups_dropped;
  j["groups_small"] = s.counters.groups_small;
  j["frames"] = s.counters.fitted;
  j["frames_unmatched"] = s.counters.frames_unmatched;
  j["fps"] = std::round(s.fps * 100) / 100;
  j["latency_ms"] = latency_json(s.latency);
  for (std::size_t i = 0; i < kStages; ++i) j["stage_ms"][kStageNames[i]] = latency_json(s.stages[i]);
  j["body_known"] = s.body_known;
  if (s.last_known) {
    j["person"] = s.last.person == PersonState::lost ? "lost" : s.last.person == PersonState::estimated ? "estimated" : "tracked";
    j["residual"] = s.last.residual;
    j["coverage"] = s.last.coverage;
    j["others"] = s.last.others;
  }
  j["remark"] = s.remark;
  j["backend"] = {{"name", s.backend.name}, {"problem", s.backend.problem}, {"losses", s.backend.losses}, {"changes", s.backend.changes}};
  j["dds_failures"] = s.dds_failures;
  if (!s.dds_problem.empty()) j["dds_problem"] = s.dds_problem;
  j["dds_security"] = s.dds_security;
  j["credential_problem"] = s.credential_problem;
  j["calibration"] = calibration_json(s.calibration);
  // Named as on DDS; what is not known is null.
  const auto known = [](auto value) { return value >= 0 ? Json(value) : Json(nullptr); };
  j["calibration_age_s"] = known(s.calibration_age_s);
  j["calibration_residual"] = known(s.calibration_residual);
  j["disk_free_bytes"] = known(s.disk.free);
  j["disk_total_bytes"] = known(s.disk.total);
  if (s.last_summary) j["last_session"] = Json::parse(s.last_summary->json, nullptr, false);
  return j;
}

std::string dump(const Json& j) {
  // Names come from devices and files: a byte that is not UTF-8 must not end the conversation.
  return j.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string error(const std::string& text) { return dump({{"ok", false}, {"error", text}}); }

std::string skeleton_json(const DaemonStatus& s) {
  Json j;
  j["ok"] = true;
  j["state"] = to_string(s.state);
  j["known"] = s.last_known;
  if (s.last_known) {
    j["frame"] = s.last.sequence;
    j["person"] = s.last.person == PersonState::lost ? "lost" : s.last.person == PersonState::estimated ? "estimated" : "tracked";
    j["joints"] = s.last.joints;
    j["q"] = s.last.q;
    j["residual"] = s.last.residual;
    j["fps"] = s.fps;
    j["latency_p50_ms"] = s.latency.p50_ms;
    j["groups_dropped"] = s.counters.groups_dropped;
  }
  return dump(j);
}

std::string command(SessionEvent event, Controller& controller) {
  const ControlAnswer answer = controller.request(event, "control");
  Json j{{"ok", answer.accepted}, {"state", to_string(answer.state)}};
  if (!answer.accepted) j["error"] = answer.text;
  return dump(j);
}

}  // namespace

std::string status_json(const DaemonStatus& status) { return dump(make_status(status)); }

std::string answer_request(const std::string& line, Controller& controller) {
  const Json request = Json::parse(line, nullptr, false);
  if (request.is_discarded()) return error("a request is one JSON object on one line");
  if (!request.is_object() || !request.contains("request") || !request["request"].is_string())
    return error("a request needs the key \"request\": \"status\", \"skeleton\", \"start\", \"stop\" or \"calibrate\"");
  const std::string what = request["request"].get<std::string>();
  if (what == "status") return status_json(controller.status());
  if (what == "skeleton") return skeleton_json(controller.status());
  if (what == "start") return command(SessionEvent::start, controller);
  if (what == "stop") return command(SessionEvent::stop, controller);
  if (what == "calibrate") return command(SessionEvent::calibrate, controller);
  return error(fmt::format("\"{}\" is not a request; there are status, skeleton, start, stop and calibrate", what));
}

}  // namespace booth::daemon

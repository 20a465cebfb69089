// Rows, reasons and their two shapes.
#include "daemon/ctl/fleet_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace booth::daemon {
namespace {

std::string known(double value, const char* format) { return std::isfinite(value) && value >= 0 ? fmt::format(fmt::runtime(format), value) : "-"; }

std::string age(double seconds) {
  if (!std::isfinite(seconds) || seconds < 0) return "-";
  return seconds < 2 * 3600    ? fmt::format("{:.0f} min", seconds / 60)
         : seconds < 2 * 86400 ? fmt::format("{:.0f} h", seconds / 3600)
                               : fmt::format("{:.0f} d", seconds / 86400);
}

std::string cameras(const StatusSample& s) {
  const auto running = std::count_if(s.cameras.begin(), s.cameras.end(), [](const auto& c) { return c.state == "running"; });
  return fmt::format("{}/{}", running, s.cameras.size());
}

}  // namespace

std::vector<FleetRow> fleet_rows(const std::map<std::string, HeardBooth>& booths, const std::vector<std::string>& expected) {
  std::vector<FleetRow> out;
  for (const auto& [id, booth] : booths) {
    FleetRow row{.id = id, .state = session_state_name(booth.status.state), .reasons = {}, .heard = &booth};
    for (const auto& [source, text] : booth.status.faults) row.reasons.push_back(source + ": " + text);
    if (!booth.status.alarm.empty() && booth.status.faults.empty()) row.reasons.push_back(booth.status.alarm);
    if (booth.twice) row.reasons.insert(row.reasons.begin(), "two booths use this name; give each its own booth.id");
    if (!booth.status_known) {
      row.state = "unknown";
      row.reasons.emplace_back("no status has come from it");
    }
    if (booth.skeleton_known && !booth.present) {
      row.state = "gone";
      row.reasons.insert(row.reasons.begin(), "its sign of life has stopped");
    } else if (!booth.skeleton_known) {
      row.reasons.emplace_back("no skeleton has come from it");
    }
    out.push_back(std::move(row));
  }
  for (const auto& id : expected)
    if (!booths.contains(id)) out.push_back({.id = id, .state = "missing", .reasons = {"not heard on this network"}, .heard = nullptr});
  std::sort(out.begin(), out.end(), [](const FleetRow& a, const FleetRow& b) { return a.id < b.id; });
  return out;
}

std::string fleet_table(const std::vector<FleetRow>& rows) {
  std::size_t width = 5;
  for (const auto& row : rows) width = std::max(width, printable(row.id).size());
  std::string out = fmt::format("{:<{}}  {:<10} {:>8} {:>8} {:>9} {:>11} {:>12}  {}\n", "booth", width, "state", "cameras", "frames/s", "residual",
                                "calibration", "disk free", "faults");
  for (const auto& row : rows) {
    std::string figures = fmt::format("{:>8} {:>8} {:>9} {:>11} {:>12}", "-", "-", "-", "-", "-");
    if (row.heard && row.heard->status_known) {
      const StatusSample& s = row.heard->status;
      figures = fmt::format("{:>8} {:>8} {:>9} {:>11} {:>12}", cameras(s), known(s.fps, "{:.1f}"), s.frames > 0 ? known(1e3 * s.residual, "{:.1f} mm") : "-",
                            age(s.calibration_age_s), known(static_cast<double>(s.disk_free_bytes) / 1e9, "{:.1f} GB"));
    }
    std::string reasons = row.reasons.empty() ? "none" : "";
    for (const auto& reason : row.reasons) reasons += (reasons.empty() ? "" : "; ") + printable(reason);
    out += fmt::format("{:<{}}  {:<10} {}  {}\n", printable(row.id), width, row.state, figures, reasons);
  }
  return out + fmt::format("{} booth{}, {} unwell\n", rows.size(), rows.size() == 1 ? "" : "s", unwell(rows));
}

std::string fleet_json(const std::vector<FleetRow>& rows) {
  using Json = nlohmann::ordered_json;
  // NaN and infinity are no JSON; what is not known is null.
  const auto number = [](double v) { return std::isfinite(v) && v >= 0 ? Json(v) : Json(nullptr); };
  Json out{{"booths", Json::array()}, {"unwell", unwell(rows)}};
  for (const auto& row : rows) {
    Json j{{"booth", row.id}, {"state", row.state}, {"well", row.reasons.empty()}, {"faults", row.reasons}};
    if (row.heard && row.heard->status_known) {
      const StatusSample& s = row.heard->status;
      j["software"] = s.software;
      j["session"] = s.session;
      j["emergency_latched"] = s.latched, j["degraded"] = s.degraded, j["paused"] = s.paused;
      j["fps"] = number(s.fps);
      j["residual"] = s.frames > 0 ? number(s.residual) : Json(nullptr);
      j["frames"] = s.frames, j["groups_dropped"] = s.groups_dropped;
      j["latency_ms"] = {{"p50", number(s.latency_p50_ms)}, {"p99", number(s.latency_p99_ms)}};
      j["calibration_age_s"] = number(s.calibration_age_s), j["calibration_residual"] = number(s.calibration_residual);
      j["disk_free_bytes"] = number(static_cast<double>(s.disk_free_bytes)), j["disk_total_bytes"] = number(static_cast<double>(s.disk_total_bytes));
      j["cameras"] = Json::array();
      for (const auto& c : s.cameras)
        j["cameras"].push_back({{"name", c.name}, {"state", c.state}, {"fps", number(c.fps)}, {"dropped", c.dropped}, {"restarts", c.restarts}});
    }
    if (row.heard) j["skeletons"] = row.heard->skeletons, j["skeletons_lost"] = row.heard->skeletons_lost;
    out["booths"].push_back(std::move(j));
  }
  return out.dump(-1, ' ', true, Json::error_handler_t::replace);
}

int unwell(const std::vector<FleetRow>& rows) {
  return static_cast<int>(std::count_if(rows.begin(), rows.end(), [](const FleetRow& row) { return !row.reasons.empty(); }));
}

}  // namespace booth::daemon

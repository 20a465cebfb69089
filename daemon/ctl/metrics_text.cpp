// One family of metrics after another: HELP, TYPE, samples.
#include "daemon/ctl/metrics_text.hpp"

#include <fmt/format.h>

#include <map>
#include <string_view>
#include <utility>
#include <vector>

namespace booth::daemon {
namespace {

using Labels = std::vector<std::pair<const char*, std::string>>;

/// Quoted as the format has it; bytes that could not stand in a line are replaced.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '\\' || c == '"')
      out += {'\\', c};
    else
      out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  }
  return out + '"';
}

class Page {
 public:
  void family(std::string_view name, std::string_view type, std::string_view help) {
    name_ = name;
    text_ += fmt::format("# HELP boothd_{0} {1}\n# TYPE boothd_{0} {2}\n", name, help, type);
  }
  void sample(double value, const Labels& labels = {}, std::string_view suffix = "") {
    text_ += fmt::format("boothd_{}{}", name_, suffix);
    for (std::size_t i = 0; i < labels.size(); ++i) text_ += fmt::format("{}{}={}", i == 0 ? "{" : ",", labels[i].first, quoted(labels[i].second));
    text_ += fmt::format("{} {}\n", labels.empty() ? "" : "}", value);
  }
  void one(std::string_view name, std::string_view type, std::string_view help, double value) {
    family(name, type, help);
    sample(value);
  }
  /// A gauge that is left out where boothd does not know it: a zero would be a value.
  void known(std::string_view name, std::string_view help, const StatusJson& status, const char* key) {
    if (has_number(status, key)) one(name, "gauge", help, number_in(status, key));
  }
  /// Milliseconds in, seconds out.
  void summary(const StatusJson& ms, Labels labels = {}) {
    for (const auto& [key, quantile] : {std::pair{"p50", "0.5"}, std::pair{"p95", "0.95"}, std::pair{"p99", "0.99"}}) {
      Labels with = labels;
      with.emplace_back("quantile", quantile);
      sample(number_in(ms, key) / 1e3, with);
    }
    sample(number_in(ms, "mean") * static_cast<double>(count_in(ms, "count")) / 1e3, labels, "_sum");
    sample(static_cast<double>(count_in(ms, "count")), labels, "_count");
  }
  std::string take() { return std::move(text_); }

 private:
  std::string name_, text_;
};

constexpr const char* kStates[] = {"idle", "countdown", "estimating", "tracking", "searching", "finishing", "calibrating"};

void add_cameras(Page& page, const StatusJson& status) {
  page.one("cameras_minimum", "gauge", "Cameras without which no session runs (cameras.minimum).", number_in(status, "cameras_minimum"));
  // Each name once: two samples with the same labels would make the whole file unreadable.
  std::map<std::string, StatusJson> cameras;
  for (const StatusJson& camera : part_of(status, "cameras"))
    if (const std::string name = text_in(camera, "name"); !name.empty()) cameras.try_emplace(quoted(name), camera);
  const auto family = [&](const char* name, const char* type, const char* help, auto value) {
    page.family(name, type, help);
    for (const auto& [label, camera] : cameras) page.sample(value(camera), {{"camera", text_in(camera, "name")}});
  };
  family("camera_up", "gauge", "1 where the camera delivers.", [](const StatusJson& c) { return text_in(c, "state") == "running" ? 1.0 : 0.0; });
  family("camera_frames_per_second", "gauge", "Rate at which the camera delivers now.", [](const StatusJson& c) { return number_in(c, "fps"); });
  family("camera_frames_delivered_total", "counter", "Frames delivered.", [](const StatusJson& c) { return number_in(c, "delivered"); });
  family("camera_frames_dropped_total", "counter", "Frames lost, by the device or for want of room.",
         [](const StatusJson& c) { return number_in(c, "dropped"); });
  family("camera_frames_corrupt_total", "counter", "Frames that arrived damaged.", [](const StatusJson& c) { return number_in(c, "corrupt"); });
  family("camera_displaced", "gauge", "1 where the camera does not stand any more where the calibration says, by the people who were captured.",
         [](const StatusJson& c) {
           const std::string verdict = text_in(part_of(c, "drift"), "verdict");
           return verdict == "moved" || verdict == "blind" ? 1.0 : 0.0;
         });
  family("camera_displacement_meters", "gauge",
         "Distance by which the camera's points of a person are off from the other cameras', root mean square; 0 where not known.",
         [](const StatusJson& c) { return number_in(part_of(c, "drift"), "displacement_mm") / 1e3; });
  family("camera_decoder_problem", "gauge", "1 where the camera's depth is not decoded by what was configured.",
         [](const StatusJson& c) { return text_in(part_of(c, "decoder"), "problem").empty() ? 0.0 : 1.0; });
  family("camera_restarts_total", "counter", "Times the camera was started anew.", [](const StatusJson& c) { return number_in(c, "restarts"); });
}

void add_pipeline(Page& page, const StatusJson& s) {
  // These begin at zero with every session, which counters may.
  page.one("groups_total", "counter", "Groups of frames formed, this session.", number_in(s, "groups"));
  page.one("groups_dropped_total", "counter", "Groups overtaken by a newer one, this session.", number_in(s, "groups_dropped"));
  page.one("groups_small_total", "counter", "Groups with fewer cameras than the minimum, this session.", number_in(s, "groups_small"));
  page.one("frames_unmatched_total", "counter", "Frames in no group, this session.", number_in(s, "frames_unmatched"));
  page.one("frames_fitted_total", "counter", "Frames fitted, this session.", number_in(s, "frames"));
  page.one("fitted_frames_per_second", "gauge", "Rate of fitted frames, this session.", number_in(s, "fps"));
  page.family("latency_seconds", "summary", "From the cameras to DDS, this session.");
  page.summary(part_of(s, "latency_ms"));
  page.family("stage_seconds", "summary", "Time spent in each stage of the pipeline, this session.");
  const StatusJson stages = part_of(s, "stage_ms");
  for (auto it = stages.begin(); it != stages.end(); ++it)
    if (stages.is_object()) page.summary(it.value(), {{"stage", it.key()}});
}

void add_health(Page& page, const StatusJson& s) {
  page.family("state", "gauge", "1 for the state in which boothd is.");
  for (const char* state : kStates) page.sample(text_in(s, "state") == state ? 1 : 0, {{"state", state}});
  page.one("degraded", "gauge", "1 where a camera is missing.", flag_in(s, "degraded"));
  page.one("paused", "gauge", "1 where fewer cameras deliver than the minimum.", flag_in(s, "paused"));
  page.one("emergency_stop", "gauge", "1 where the emergency stop is pressed.", flag_in(s, "emergency_latched"));
  page.one("alarm", "gauge", "1 where a person should look after something; boothctl status says what.", text_in(s, "alarm").empty() ? 0 : 1);
  page.one("panel_problems", "gauge", "Troubles with buttons and light.", static_cast<double>(part_of(part_of(s, "panel"), "problems").size()));
  page.one("credential_problem", "gauge", "1 where the DDS credentials expire soon or have expired.", text_in(s, "credential_problem").empty() ? 0 : 1);
  page.one("dds_failures_total", "counter", "Samples that could not be written.", number_in(s, "dds_failures"));
  page.one("backend_problem", "gauge", "1 where the fit is not computed by what was configured.", text_in(part_of(s, "backend"), "problem").empty() ? 0 : 1);
  page.one("backend_losses_total", "counter", "Times the device that computes the fit was lost.", number_in(part_of(s, "backend"), "losses"));
  page.known("calibration_age_seconds", "Time since the cameras were calibrated; absent where not known.", s, "calibration_age_s");
  page.known("calibration_residual_meters", "Held-out error of that calibration between two cameras; absent where not known.", s, "calibration_residual");
  page.known("disk_free_bytes", "Room where sessions are kept.", s, "disk_free_bytes");
  page.known("disk_size_bytes", "Size of the disk where sessions are kept.", s, "disk_total_bytes");
  const StatusJson recorder = part_of(s, "recorder");
  page.one("recorder_held_seconds", "gauge", "How far back the black box reaches.", number_in(recorder, "seconds_held"));
  page.one("recorder_held_bytes", "gauge", "Memory that the black box fills.", number_in(recorder, "bytes_held"));
  page.one("recorder_frames_dropped_total", "counter", "Frames that found the recorder busy.", number_in(recorder, "dropped"));
}

}  // namespace

std::string metrics_text(const StatusJson& status) {
  Page page;
  const bool up = flag_in(status, "ok");
  page.one("up", "gauge", "1 where boothd is ready and answers.", up);
  if (up) {
    add_health(page, status);
    add_cameras(page, status);
    add_pipeline(page, status);
  }
  return page.take();
}

}  // namespace booth::daemon

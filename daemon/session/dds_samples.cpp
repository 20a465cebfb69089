// Status and body as samples.
#include "daemon/session/dds_samples.hpp"

#include <fmt/format.h>

#include "daemon/session/drift_words.hpp"
#include "fit/body/measure.hpp"

namespace booth::daemon {
namespace {

constexpr std::int64_t kLowDisk = 1'000'000'000;  ///< bytes: a few sessions more, and their files will not be written

void add_faults(StatusSample& out, const DaemonStatus& s) {
  const auto add = [&](const char* source, std::string text) { out.faults.emplace_back(source, std::move(text)); };
  if (!s.credential_problem.empty()) add("dds", s.credential_problem);
  if (!s.alarm.empty() && s.alarm != s.credential_problem && s.alarm != s.drift_problem) add("session", s.alarm);
  for (const auto& problem : s.panel.problems)
    if (problem != s.alarm) add("gpio", problem);
  if (s.latched) add("panel", "the emergency stop is pressed");
  if (s.paused) add("cameras", "too few cameras deliver; the fit is paused");
  for (const auto& c : s.cameras)
    if (c.state != CameraState::running)
      add("cameras", fmt::format("camera {} is {}{}{}", c.name, to_string(c.state), c.problem.empty() ? "" : ": ", c.problem));
  for (std::size_t c = 0; c < s.drift.size() && c < s.cameras.size(); ++c)
    if (off_its_place(s.drift[c])) add("cameras", drift_sentence(s.cameras[c].name, s.drift[c]));
  for (const auto& c : s.cameras)
    if (!c.decoding.problem.empty()) add("cameras", fmt::format("depth of camera {} is decoded by {}: {}", c.name, c.decoding.name, c.decoding.problem));
  if (!s.backend.problem.empty()) add("fit", fmt::format("{}: {}", s.backend.name, s.backend.problem));
  if (out.disk_free_bytes >= 0 && out.disk_free_bytes < kLowDisk)
    add("disk", fmt::format("only {} MB are free where sessions are kept", out.disk_free_bytes / 1'000'000));
}

}  // namespace

StatusSample status_sample(const DaemonStatus& s) {
  StatusSample out;
  out.state = wire_state(s.state);
  out.degraded = s.degraded;
  out.paused = s.paused;
  out.latched = s.latched;
  out.software = s.software;
  out.session = s.session;
  out.alarm = s.alarm;
  for (const auto& camera : s.cameras) {
    out.cameras.push_back({.name = camera.name,
                           .state = to_string(camera.state),
                           .fps = static_cast<float>(camera.fps),
                           .delivered = camera.counters.delivered,
                           .dropped = camera.counters.dropped + camera.no_slot,
                           .restarts = camera.restarts});
  }
  out.frames = s.counters.fitted;
  out.groups_dropped = s.counters.groups_dropped;
  out.fps = static_cast<float>(s.fps);
  out.latency_p50_ms = static_cast<float>(s.latency.p50_ms);
  out.latency_p99_ms = static_cast<float>(s.latency.p99_ms);
  out.residual = s.last_known ? s.last.residual : 0;
  out.calibration_age_s = s.calibration_age_s;
  out.calibration_residual = s.calibration_residual;
  out.disk_free_bytes = s.disk.free;
  out.disk_total_bytes = s.disk.total;
  add_faults(out, s);
  return out;
}

BodySample body_sample(const FrameRecord& frame, const fit::BodyModel& model, const std::string& session) {
  BodySample out;
  out.session = session;
  out.sex = frame.sex;
  out.model_version = model.data().version;
  out.beta.assign(frame.beta.begin(), frame.beta.begin() + frame.shape_count);
  const Eigen::Map<const Eigen::VectorXd> beta(frame.beta.data(), frame.shape_count);
  const fit::Points3 bones = model.bone_vectors(beta);
  for (std::size_t b = 0; b < kRecordJoints; ++b) out.bone_lengths[b] = bones.col(static_cast<Eigen::Index>(b)).norm();
  try {
    for (const auto& m : fit::measure(model, beta)) out.measurements.push_back({.name = std::string(m.name), .unit = std::string(m.unit), .value = m.value});
  } catch (const std::invalid_argument&) {
    // A model without landmarks has a shape, but nothing that a tape could be laid around.
  }
  return out;
}

}  // namespace booth::daemon

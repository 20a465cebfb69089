// Faults first, then frames.
#include "daemon/ctl/health_gate.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace booth::daemon {

void HealthGate::count(const StatusJson& status) {
  cameras_.clear();
  for (const StatusJson& camera : part_of(status, "cameras")) {
    Camera seen{text_in(camera, "name"), text_in(camera, "state")};
    const std::uint64_t delivered = count_in(camera, "delivered");
    const auto [at, is_new] = first_.try_emplace(seen.name, delivered);
    if (delivered < at->second) at->second = delivered;  // it was opened anew and counts from zero
    seen.frames = delivered - at->second;
    cameras_.push_back(std::move(seen));
  }
}

HealthVerdict HealthGate::look(const StatusJson& status) {
  if (!flag_in(status, "ok") || text_in(status, "state").empty()) {
    forget();
    return {false, "boothd answers, but not with its status"};
  }
  if (const std::string runs = text_in(status, "software"); !demand_.software.empty() && runs != demand_.software)
    return {false, fmt::format("{} answers where {} is installed; systemctl restart boothd", runs.empty() ? "a boothd that does not say its version" : runs,
                               demand_.software)};
  count(status);
  // The alarm covers sessions that cannot be saved, buttons and light, and credentials. The emergency stop is no fault: a person pressed it.
  if (const std::string alarm = text_in(status, "alarm"); !alarm.empty()) return {false, "boothd raises an alarm: " + alarm};

  const auto minimum = std::max<std::size_t>(1, count_in(status, "cameras_minimum"));
  std::size_t running = 0, enough = 0;
  std::string missing, slowest;
  std::uint64_t fewest = demand_.frames;
  for (const Camera& camera : cameras_) {
    const bool runs = camera.state == "running";
    running += runs;
    enough += runs && camera.frames >= demand_.frames;
    if (!runs) missing = fmt::format("camera {} is {}", camera.name, camera.state);
    if (runs && camera.frames < fewest) {
      fewest = camera.frames;
      slowest = camera.name;
    }
  }
  if (!cameras_.empty()) {
    const std::size_t wanted = demand_.every_camera ? cameras_.size() : std::min(minimum, cameras_.size());
    if (running < wanted) return {false, fmt::format("{} of {} cameras deliver, {} are needed; {}", running, cameras_.size(), wanted, missing)};
    // Whoever delivers has to deliver enough: a camera that starts and stops again and again is no sign of health.
    if (enough < running) return {false, fmt::format("camera {} has delivered {} of {} frames", slowest, fewest, demand_.frames)};
  }
  return {true, fmt::format("ready, {}, {} of {} cameras deliver{}", text_in(status, "state"), running, cameras_.size(),
                            missing.empty() ? "" : " (" + missing + ")")};
}

}  // namespace booth::daemon

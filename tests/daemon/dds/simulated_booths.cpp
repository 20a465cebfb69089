// Many booths in one light program: real DDS links with a skeleton that waves, and nothing behind them. For tests and to try a console.
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "daemon/dds/dds_link.hpp"
#include "drivers/clock/system_clock.hpp"

namespace {

using namespace booth;

volatile std::sig_atomic_t ended = 0;

/// A T-pose of 24 joints that sways; enough for a figure.
daemon::FrameRecord frame_at(std::uint64_t n, double phase) {
  daemon::FrameRecord out;
  out.sequence = n;
  out.session_state = 2;
  out.person = daemon::PersonState::tracked;
  out.residual = 0.008f;
  out.cameras = 4;
  out.shape_count = 10;
  for (std::size_t j = 0; j < daemon::kRecordJoints; ++j) {
    const double a = 0.4 * static_cast<double>(j);
    out.joints[j] = {0.1 * std::sin(a), 0.3 * std::cos(a) + 0.1 * std::sin(0.1 * static_cast<double>(n) + phase), 0.07 * static_cast<double>(j)};
    out.rotation[j] = {0, 0, 0, 1};
    out.seen[j] = 1;
  }
  return out;
}

daemon::StatusSample status_of(std::size_t booth, std::uint64_t frames, bool unwell) {
  daemon::StatusSample out;
  out.state = 2;
  out.software = "boothd simulated";
  out.session = "20260101T000000Z-" + std::to_string(booth);
  for (int c = 0; c < 4; ++c) out.cameras.push_back({.name = "camera " + std::to_string(c), .state = unwell && c == 0 ? "lost" : "running", .fps = 30});
  if (unwell) out.faults.emplace_back("cameras", "camera 0 is lost: the cable was pulled");
  out.degraded = unwell;
  out.frames = frames;
  out.fps = 30;
  out.residual = 0.008f;
  out.latency_p50_ms = 40;
  out.latency_p99_ms = 60;
  out.calibration_age_s = 86400.0 * static_cast<double>(booth + 1);
  out.calibration_residual = 0.002;
  out.disk_free_bytes = 100'000'000'000;
  out.disk_total_bytes = 500'000'000'000;
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::cerr
        << "usage: booth-simulated DOMAIN PREFIX COUNT [INTERFACE] [UNWELL]\n"
           "Publishes COUNT booths PREFIX0 ... at 30 skeletons/s on the loopback interface (or INTERFACE), the first UNWELL of them with a lost camera.\n";
    return 64;
  }
  const auto domain = static_cast<std::uint32_t>(std::atoi(argv[1]));
  const std::string prefix = argv[2], interface = argc > 4 ? argv[4] : "lo";
  const std::size_t count = static_cast<std::size_t>(std::atoi(argv[3])), unwell = argc > 5 ? static_cast<std::size_t>(std::atoi(argv[5])) : 0;
  for (const int s : {SIGTERM, SIGINT}) std::signal(s, [](int) { ended = 1; });
  drivers::SystemClock clock;
  std::vector<std::unique_ptr<daemon::DdsLink>> links;
  try {
    for (std::size_t i = 0; i < count; ++i) {
      const std::string name = prefix + std::to_string(i);
      links.push_back(std::make_unique<daemon::DdsLink>(
          daemon::DdsSettings{.booth = name, .domain = domain, .interface = interface, .multicast = interface != "lo", .peers = {}}, clock,
          [](daemon::DdsCommand) { return daemon::DdsAnswer{.accepted = true, .state = 2}; }));
    }
  } catch (const std::exception& e) {
    std::cerr << "booth-simulated: " << e.what() << "\n";
    return 69;
  }
  auto next = clock.now();
  for (std::uint64_t n = 0; !ended; ++n) {
    for (std::size_t i = 0; i < links.size(); ++i) {
      links[i]->publish(frame_at(n, static_cast<double>(i)));
      if ((n + i) % 30 == 0) links[i]->publish(status_of(i, n, i < unwell));
    }
    next += std::chrono::nanoseconds(33'333'333);
    clock.sleep_until(next);
  }
}

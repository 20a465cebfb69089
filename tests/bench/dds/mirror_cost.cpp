// Both booths take turns, so that a neighbour on the processor hits both.
#include "tests/bench/dds/mirror_cost.hpp"

#include <dds/dds.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "daemon/dds/dds_link.hpp"
#include "daemon/dds/participant.hpp"
#include "daemon/dds/ros2/ros2_topics.hpp"
#include "daemon/dds/topics.hpp"
#include "drivers/clock/system_clock.hpp"
#include "fit/cloud/observation.hpp"

namespace booth::bench {
namespace {

using daemon::DdsTopic;

/// Shared by the two processes.
struct Notice {
  std::atomic<bool> found{false}, end{false};
};

daemon::DdsAnswer no(daemon::DdsCommand) { return {}; }

double microseconds(clockid_t clock) {
  timespec t{};
  ::clock_gettime(clock, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

struct PublishCost {
  std::vector<double> call_us;  ///< one call of publish() on the fit's side
  double processor_us = 0;      ///< of the whole process, a frame
};

/// At 30 frames/s' worth of clouds, faster.
void publish_turn(daemon::DdsLink& link, const fit::Cloud& cloud, int frames, PublishCost& out) {
  daemon::FrameRecord frame;
  frame.shape_count = 20;
  frame.person = daemon::PersonState::tracked;
  const double begin = microseconds(CLOCK_PROCESS_CPUTIME_ID);
  for (int i = 0; i < frames; ++i) {
    frame.captured_ns += 33'333'333;
    const double before = microseconds(CLOCK_MONOTONIC);
    link.offer_cloud(cloud, frame.captured_ns);
    link.publish(frame);
    out.call_us.push_back(microseconds(CLOCK_MONOTONIC) - before);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  out.processor_us += (microseconds(CLOCK_PROCESS_CPUTIME_ID) - begin) / frames;
}

/// The other process: subscribed to the skeletons of all booths and to all topics of the mirror, of which it reads nothing.
void subscribe_until_end(daemon::DdsSettings settings, const std::string& mirrored, Notice& notice) {
  settings.booth = "*";
  const daemon::DdsParticipant dds(settings);
  std::vector<dds_entity_t> readers{daemon::make_reader(dds.participant(), dds.subscriber(), DdsTopic::skeleton)};
  for (int t = 0; t < daemon::kRos2Topics; ++t) {
    const auto topic = static_cast<daemon::Ros2Topic>(t);
    const std::string name = "rt" + daemon::ros2_topic_name(topic, daemon::RosNames(mirrored, ""));
    const dds_entity_t made = dds_create_topic(dds.participant(), daemon::ros2_topic_info(topic).type, name.c_str(), nullptr, nullptr);
    const daemon::DdsQos qos;
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, 0);
    readers.push_back(dds_create_reader(dds.participant(), made, qos, nullptr));
  }
  while (!notice.end && ::getppid() != 1) {
    const auto matched = [](dds_entity_t reader) {
      dds_subscription_matched_status_t status{};
      return dds_get_subscription_matched_status(reader, &status) == 0 && status.current_count > 0;
    };
    if (std::all_of(readers.begin(), readers.end(), matched)) notice.found = true;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace

void add_mirror_cost(Report& report, std::uint32_t domain, int turns) {
  daemon::DdsSettings settings{.booth = "plain", .domain = domain, .interface = "lo", .multicast = false, .peers = {}};
  void* memory = ::mmap(nullptr, sizeof(Notice), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::runtime_error("no shared memory for the reader's word");
  Notice& notice = *new (memory) Notice;
  const pid_t child = ::fork();
  if (child == 0) {
    subscribe_until_end(settings, "mirrored", notice);
    ::_exit(0);
  }
  drivers::SystemClock clock;
  daemon::DdsLink plain(settings, clock, no);
  settings.booth = "mirrored";
  settings.ros2 = daemon::Ros2Settings{};
  daemon::DdsLink mirrored(settings, clock, no);
  const fit::Cloud cloud = [] {
    fit::Cloud out(20'000);
    while (out.push(Eigen::Vector3f::Zero(), Eigen::Vector3f::Zero(), 0)) {
    }
    return out;
  }();
  for (int i = 0; !notice.found; ++i) {
    if (i == 6000) throw std::runtime_error("the other process found no booth");
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  PublishCost without, with;
  for (int turn = 0; turn < turns; ++turn) {
    publish_turn(plain, cloud, 200, without);
    publish_turn(mirrored, cloud, 200, with);
  }
  notice.end = true;
  ::waitpid(child, nullptr, 0);
  ::munmap(memory, sizeof(Notice));
  for (const double q : {0.5, 0.99}) {
    const auto at = [&](std::vector<double>& v) {
      std::sort(v.begin(), v.end());
      return v[static_cast<std::size_t>(q * static_cast<double>(v.size() - 1))];
    };
    report.add({.name = fmt::format("a frame with the ROS 2 mirror, call of the fit's thread, p{:.0f}", 100 * q),
                .unit = "us",
                .value = at(with.call_us),
                .reference = "without it",
                .reference_value = at(without.call_us)});
  }
  report.add({.name = "a frame with the ROS 2 mirror, processor time of the process",
              .unit = "us",
              .value = with.processor_us / turns,
              .reference = "without it",
              .reference_value = without.processor_us / turns});
}

}  // namespace booth::bench

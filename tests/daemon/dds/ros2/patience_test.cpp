// The mirror costs the fit a copy: nothing is allocated, and a node that hangs makes nobody wait.
#include <gtest/gtest.h>
#include <pthread.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <vector>

#include "daemon/dds/dds_link.hpp"
#include "daemon/dds/ros2/ros2_topics.hpp"
#include "drivers/clock/system_clock.hpp"
#include "ros2_messages.h"
#include "tests/daemon/dds/peer.hpp"
#include "tests/daemon/dds/ros2/expectations.hpp"
#include "tests/daemon/dds/stopped_reader.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/support/allocation_count.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

struct Ros2Patience : ::testing::Test {
  drivers::SystemClock clock;
  daemon::DdsSettings settings() {
    daemon::DdsSettings out = loopback("b");
    out.ros2 = daemon::Ros2Settings{.cameras = two_cameras()};
    return out;
  }
  daemon::DdsLink link{settings(), clock, [](daemon::DdsCommand) { return daemon::DdsAnswer{}; }};
};

TEST_F(Ros2Patience, NothingIsAllocatedForAFrame) {
  if (!AllocationCount::supported()) GTEST_SKIP() << "skipped: the sanitizer brings its own malloc";
  Peer node("");
  const dds_entity_t tf = node.reader(tf2_msgs_msg_dds__TFMessage__desc, "rt/tf", true);
  ASSERT_TRUE(eventually([&] { return has_writer(tf); }, 60s));
  const fit::Cloud cloud = numbered_cloud(20'000);
  std::uint64_t counted = 0, excused = 0, heard = 0;
  std::string places;
  std::thread fit([&] {
    ::pthread_setname_np(::pthread_self(), "frame-fit");
    for (int n = 1; n <= 320; ++n) {
      static std::optional<AllocationCount> count;
      if (n == 21) count.emplace(std::initializer_list<const char*>{"libddsc"});
      const daemon::FrameRecord frame = posed_frame(static_cast<std::uint64_t>(n));
      link.offer_cloud(cloud, frame.captured_ns);
      link.publish(frame);
      if (n % 10 == 0) link.publish_idle(0);
      std::this_thread::sleep_for(2ms);
      if (n < 320) continue;
      std::this_thread::sleep_for(50ms);
      counted = count->on_frame_threads();  // this thread and the mirror's
      excused = count->excused_on_frame_threads();
      places = count->first_places();
      count.reset();
    }
  });
  fit.join();
  while (take<tf2_msgs_msg_dds__TFMessage_>(
      tf, [&](const auto&) { ++heard; }, 50ms)) {
  }
  EXPECT_EQ(counted, 0u) << places;
  EXPECT_GT(excused, 0u) << "Cyclone DDS takes memory for what it sends: the count looks at the right threads";
  EXPECT_GT(heard, 100u);
}

TEST_F(Ros2Patience, AStoppedNodeStopsNothing) {
  StoppedReader stopped("ros2");
  ASSERT_TRUE(stopped.found);
  Peer peer("");
  const dds_entity_t joints = peer.reader(geometry_msgs_msg_dds__PoseArray__desc, "rt/humans/bodies/b/joints", true);
  ASSERT_TRUE(eventually([&] { return has_writer(joints); }, 60s));
  const fit::Cloud cloud = numbered_cloud(20'000);
  // Far more than any history holds: the clouds alone are 10 MB, with a mark of 4 MiB at which the library would hold writers up.
  constexpr int kFrames = 1500;
  std::vector<double> milliseconds;
  int heard = 0;
  std::int64_t last = 0;
  for (int n = 1; n <= kFrames; ++n) {
    const daemon::FrameRecord frame = posed_frame(static_cast<std::uint64_t>(n));
    const auto begin = Clock::now();
    link.offer_cloud(cloud, frame.captured_ns);
    link.publish(frame);
    milliseconds.push_back(std::chrono::duration<double, std::milli>(Clock::now() - begin).count());
    std::this_thread::sleep_for(1ms);
    if (n % 20 == 0) {
      while (take<geometry_msgs_msg_dds__PoseArray_>(
          joints,
          [&](const geometry_msgs_msg_dds__PoseArray_& m) {
            const std::int64_t now = std::int64_t{m.header.stamp.sec} * 1'000'000'000 + m.header.stamp.nanosec;
            EXPECT_GT(now, last) << "never backwards";
            last = now;
            ++heard;
          },
          5ms)) {
      }
    }
  }
  EXPECT_EQ(link.failures(), 0u) << link.last_failure();
  EXPECT_GT(heard, kFrames / 10) << "a node beside it hears on";
  std::sort(milliseconds.begin(), milliseconds.end());
  const double p99 = milliseconds[milliseconds.size() * 99 / 100];
  std::cout << "a frame with its cloud, a stopped node on every topic: p50 " << milliseconds[milliseconds.size() / 2] << " ms, p99 " << p99 << " ms, max "
            << milliseconds.back() << " ms; " << heard << " of " << kFrames << " heard beside it\n";
  // As in HostileDds.AStoppedReaderStopsNothing: a writer that waits for readers waits at least the library's 10 ms, again and again.
  EXPECT_LT(p99, 10);
}

}  // namespace
}  // namespace booth::tests

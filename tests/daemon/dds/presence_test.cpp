// A booth that dies is missed within a second; many booths share a domain; who comes late is told at once.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <iostream>

#include "daemon/dds/booth_listener.hpp"
#include "daemon/dds/dds_link.hpp"
#include "daemon/dds/topics.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/dds/peer.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/program.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using daemon::DdsLink;

daemon::DdsAnswer no(daemon::DdsCommand) { return {}; }

struct Ear : ::testing::TestWithParam<int> {
  TemporaryFolder folder;
  Peer peer{"victim0"};
  dds_entity_t reader = 0;
  void SetUp() override {
    dds_qos_t* qos = dds_create_qos();
    dds_qset_deadline(qos, DDS_MSECS(200));
    dds_qset_liveliness(qos, DDS_LIVELINESS_AUTOMATIC, daemon::kSkeletonLease);
    reader = dds_create_reader(peer.subscriber_, peer.topic(booth_msg_Skeleton_desc, "booth/skeleton"), qos, nullptr);
    dds_delete_qos(qos);
  }
  std::uint32_t alive() const {
    dds_liveliness_changed_status_t status{};
    dds_get_liveliness_changed_status(reader, &status);
    return status.alive_count;
  }
  std::uint32_t missed() const {
    dds_requested_deadline_missed_status_t status{};
    dds_get_requested_deadline_missed_status(reader, &status);
    return status.total_count;
  }
};

TEST_P(Ear, MissesABoothWithinASecond) {
  // On a busy machine one try may be late; that all are would mean that the promise is not kept.
  auto best = 3600'000ms;
  for (int attempt = 0; attempt < 5 && best > 1000ms; ++attempt) {
    const Program booth("booth-simulated", {std::to_string(test_domain()), "victim", "1"}, folder.path / "booth");
    ASSERT_TRUE(eventually([&] { return alive() > 0; }, 60s));
    ASSERT_TRUE(take<booth_msg_Skeleton>(reader, [](const auto&) {}));
    const std::uint32_t missed_before = missed();
    booth.signal(GetParam());
    const auto begin = Clock::now();
    ASSERT_TRUE(eventually([&] { return alive() == 0; }, 60s));
    best = std::min(best, std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - begin));
    EXPECT_GT(missed(), missed_before) << "the deadline tells it, too";
  }
  std::cout << "missed after " << best.count() << " ms\n";
  EXPECT_LE(best, 1000ms);
}
INSTANTIATE_TEST_SUITE_P(Dds, Ear, ::testing::Values(SIGKILL, SIGSTOP), [](const auto& test) { return test.param == SIGKILL ? "Killed" : "Paused"; });

TEST(DdsPresence, ManyBoothsOnOneDomainAreToldApart) {
  drivers::SystemClock clock;
  DdsLink one(loopback("one"), clock, no), two(loopback("two"), clock, no);
  daemon::StatusSample status;
  status.software = "boothd test";
  one.publish(status);
  status.faults = {{"cameras", "one is missing"}};
  two.publish(status);
  daemon::BoothListener all(loopback("*")), only(loopback("two"));
  ASSERT_TRUE(eventually(
      [&] {
        one.publish_idle(0);
        two.publish_idle(0);
        all.poll(20ms);
        only.poll(20ms);
        const auto known = [](const auto& b) { return b.second.status_known && b.second.skeleton_known; };
        return all.booths().size() == 2 && std::all_of(all.booths().begin(), all.booths().end(), known) && only.booths().size() == 1 &&
               known(*only.booths().begin());
      },
      30s));
  EXPECT_EQ(only.booths().begin()->first, "two");
  EXPECT_TRUE(all.booths().at("one").status.faults.empty());
  EXPECT_EQ(all.booths().at("two").status.faults.at(0).second, "one is missing");
  EXPECT_FALSE(all.booths().at("one").twice);
}

TEST(DdsPresence, TwoBoothsOfOneNameAreFoundOut) {
  drivers::SystemClock clock;
  DdsLink one(loopback("same"), clock, no), two(loopback("same"), clock, no);
  daemon::BoothListener all(loopback("*"));
  EXPECT_TRUE(eventually(
      [&] {
        one.publish_idle(0);
        all.poll(10ms);
        two.publish_idle(0);
        all.poll(10ms);
        const auto it = all.booths().find("same");
        return it != all.booths().end() && it->second.twice;
      },
      30s));
}

TEST(DdsPresence, ABoothThatEndsIsGone) {
  drivers::SystemClock clock;
  daemon::BoothListener all(loopback("*"));
  {
    DdsLink link(loopback("short"), clock, no);
    ASSERT_TRUE(eventually(
        [&] {
          link.publish_idle(0);
          all.poll(20ms);
          return all.booths().contains("short") && all.booths().at("short").present;
        },
        30s));
  }
  EXPECT_TRUE(eventually(
      [&] {
        all.poll(20ms);
        return !all.booths().at("short").present;
      },
      30s));
}

}  // namespace
}  // namespace booth::tests

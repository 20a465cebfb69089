// Readers that stop, histories that are full, floods, and bytes that are no DDS at all: the booth goes on as if nothing were.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <iostream>
#include <random>

#include "daemon/dds/booth_listener.hpp"
#include "daemon/dds/dds_link.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/dds/peer.hpp"
#include "tests/daemon/dds/stopped_reader.hpp"
#include "tests/daemon/support/fake_booth.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using daemon::DdsLink;

struct HostileDds : ::testing::Test {
  drivers::SystemClock clock;
  std::atomic<int> carried_out{0};
  DdsLink link{loopback("b"), clock, [this](daemon::DdsCommand) {
                 ++carried_out;
                 return daemon::DdsAnswer{.accepted = true};
               }};
};

TEST_F(HostileDds, AStoppedReaderStopsNothing) {
  StoppedReader stopped;
  ASSERT_TRUE(stopped.found);
  Peer peer("b");
  const dds_entity_t events = peer.reader(booth_msg_Event_desc, "booth/event", true);
  ASSERT_TRUE(eventually([&] { return has_writer(events); }, 60s));
  // Far more than the history holds; whoever reads along gets them all.
  constexpr int kEvents = 3000;
  daemon::FrameRecord frame;
  std::uint64_t heard = 0, gaps = 0, last = 0;
  std::vector<double> milliseconds;
  const auto timed = [&](auto call) {
    const auto begin = Clock::now();
    call();
    milliseconds.push_back(std::chrono::duration<double, std::milli>(Clock::now() - begin).count());
  };
  for (int i = 0; i < kEvents; ++i) {
    timed([&] { link.publish_event("trigger", "test", std::string(160, 'x')); });
    timed([&] { link.publish(frame); });
    timed([&] { link.publish(daemon::StatusSample{}); });
    if (i % 50 == 49) {
      while (heard < static_cast<std::uint64_t>(i + 1) && take<booth_msg_Event>(events, [&](const booth_msg_Event& e) {
               gaps += e.serial_number != last + 1;
               last = e.serial_number;
               ++heard;
             }))
        ;
    }
  }
  EXPECT_EQ(heard, static_cast<std::uint64_t>(kEvents));
  EXPECT_EQ(gaps, 0u);
  EXPECT_EQ(link.failures(), 0u) << link.last_failure();
  std::sort(milliseconds.begin(), milliseconds.end());
  const double p99 = milliseconds[milliseconds.size() * 99 / 100];
  std::cout << "a call with a stopped reader on every topic: p50 " << milliseconds[milliseconds.size() / 2] << " ms, p99 " << p99 << " ms, max "
            << milliseconds.back() << " ms\n";
  // A writer that waits for readers waits at least the library's 10 ms, again and again; a neighbour on the processor costs a few single calls.
  EXPECT_LT(p99, 10);
}

TEST_F(HostileDds, AFloodOfCommandsIsHarmless) {
  Peer flooder("b"), honest("b");
  const dds_entity_t flood = flooder.writer(booth_msg_Command_desc, "booth/command");
  const dds_entity_t writer = honest.writer(booth_msg_Command_desc, "booth/command");
  const dds_entity_t replies = honest.reader(booth_msg_Reply_desc, "booth/reply", true);
  ASSERT_TRUE(eventually([&] { return has_reader(flood) && has_reader(writer) && has_writer(replies); }, 60s));
  std::atomic<bool> stop{false};
  std::atomic<std::uint64_t> sent{0};
  std::thread thread([&] {
    for (std::uint64_t i = 0; !stop; ++i) {
      // Every third under another booth's name: instances that must not pile up.
      auto c = command(i % 3 == 0 ? ("other" + std::to_string(i)).c_str() : "b", "flood", i, booth_msg_COMMAND_START);
      sent += dds_write(flood, &c) == 0;
      if (i % 100 == 99) std::this_thread::sleep_for(1ms);
    }
  });
  // The same command until it is answered, as docs/guide/subscribe.md says: a flood may push it out of the booth's short queue.
  const auto mine = command("b", "honest", 1, booth_msg_COMMAND_STOP);
  bool answered = false;
  const auto look = [&] {
    take<booth_msg_Reply>(
        replies, [&](const booth_msg_Reply& r) { answered |= std::string(r.sender) == "honest" && r.accepted; }, 20ms);
    return answered;
  };
  // By the clock, not by what is taken: answers to the flood trickle in, too, and each would put the next try off.
  for (const auto end = std::chrono::steady_clock::now() + 60s; !answered && std::chrono::steady_clock::now() < end;) {
    dds_write(writer, &mine);
    eventually(look, 300ms);
  }
  std::this_thread::sleep_for(500ms);
  stop = true;
  thread.join();
  EXPECT_TRUE(answered);
  EXPECT_GT(link.commands_ignored(), 100u);
  std::cout << sent << " sent, " << carried_out << " carried out, " << link.commands_ignored() << " ignored\n";
  EXPECT_LT(carried_out * 10u, sent.load());
}

TEST_F(HostileDds, BytesThatAreNoDdsAreHarmless) {
  Peer peer("b");
  const dds_entity_t status = peer.reader(booth_msg_Status_desc, "booth/status", true, true);
  const int fd = ::socket(AF_INET, SOCK_DGRAM, 0);
  ASSERT_GE(fd, 0);
  std::mt19937 random(1);
  // Something that looks like the start of a message of the protocol, then anything.
  const std::vector<std::uint8_t> head{'R', 'T', 'P', 'S', 2, 1, 1, 16};
  for (int i = 0; i < 4000; ++i) {
    std::vector<std::uint8_t> bytes(random() % 1400);
    for (auto& b : bytes) b = static_cast<std::uint8_t>(random() % (i % 2 ? 256 : 32));
    if (i % 4 != 0) bytes.insert(bytes.begin(), head.begin(), head.end());
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    // Discovery and data of the first participants of the domain, by the protocol's rule of ports.
    to.sin_port = htons(static_cast<std::uint16_t>(7400 + 250 * test_domain() + 10 + random() % 8));
    ::sendto(fd, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  }
  ::close(fd);
  daemon::StatusSample sample;
  sample.software = "still there";
  link.publish(sample);
  EXPECT_TRUE(take<booth_msg_Status>(
      status, [](const booth_msg_Status& s) { EXPECT_STREQ(s.software, "still there"); }, 60s));
}

TEST(Printable, NothingFromTheNetworkReachesTheTerminal) {
  EXPECT_EQ(daemon::printable("caf\xC3\xA9 1"), "caf\xC3\xA9 1");
  EXPECT_EQ(daemon::printable("\033[2Jx\r\n\a\x7F"), "?[2Jx????");
  EXPECT_EQ(daemon::printable("\xC2\x9B"
                              "2J"),
            "?2J")
      << "one byte that begins an escape sequence";
  EXPECT_EQ(daemon::printable("\xFF\xC3"
                              "a\xE2\x82"),
            "??a??");
  EXPECT_LE(daemon::printable(std::string(5000, 'a')).size(), 400u);
}

}  // namespace
}  // namespace booth::tests

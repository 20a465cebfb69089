// A booth and a console in network namespaces of their own, with a bad cable between them: the booth never stalls, the console hears again.
// BOOTHD_CUT_SECONDS=10 makes the cut as long as a switch takes to start.
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <sys/socket.h>
#include <array>
#include <cstring>
#include <functional>
#include <iostream>
#include <memory>

#include "daemon/dds/dds_link.hpp"
#include "daemon/dds/participant.hpp"
#include "daemon/dds/topics.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/dds/network/faulty_wire.hpp"
#include "tests/daemon/dds/network/namespaces.hpp"
#include "tests/daemon/dds/peer.hpp"
#include "tests/daemon/support/fake_booth.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using daemon::DdsTopic;

/// What both processes write for the test to read.
struct Board {
  std::atomic<bool> end{false}, failed{false};
  char why[200] = "";
  // The booth's.
  std::atomic<std::uint64_t> published{0}, events{0}, commands{0};
  std::atomic<std::int64_t> longest_call_us{0};
  // The console's.
  std::atomic<std::uint64_t> heard{0}, backwards{0}, events_heard{0}, event_gaps{0}, statuses{0}, replies{0}, asked{0};
  std::atomic<std::int64_t> late_us{0};  ///< sum over heard skeletons
  std::atomic<bool> alive{false};
};

void fail(Board& board, const std::string& why) {
  std::strncpy(board.why, why.c_str(), sizeof board.why - 1);
  board.failed = true;
}

std::int64_t monotonic_ns() { return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now().time_since_epoch()).count(); }

daemon::DdsSettings settings(const char* interface) { return {.booth = "net", .domain = 0, .interface = interface, .multicast = true, .peers = {}}; }

void be_the_booth(Board& board) {
  drivers::SystemClock clock;
  daemon::DdsLink link(settings("cable0"), clock, [&](daemon::DdsCommand) {
    ++board.commands;
    return daemon::DdsAnswer{.accepted = true};
  });
  const auto timed = [&](auto call) {
    const auto begin = Clock::now();
    call();
    const auto us = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - begin).count();
    if (us > board.longest_call_us) board.longest_call_us = us;
  };
  daemon::FrameRecord frame;
  frame.shape_count = 20;
  daemon::StatusSample status;
  auto next = clock.now();
  for (std::uint64_t i = 0; !board.end && ::getppid() != 1; ++i) {
    timed([&] { link.publish(frame); });
    ++board.published;
    if (i % 3 == 0) {
      timed([&] { link.publish_event("state", "test", "something happened"); });
      ++board.events;
    }
    if (i % 30 == 0) timed([&] { link.publish(status); });
    next += 33'333'333ns;
    clock.sleep_until(next);
  }
}

struct Console {
  Board& board;
  daemon::DdsParticipant dds{settings("cable0")};
  dds_entity_t skeletons = daemon::make_reader(dds.participant(), dds.subscriber(), DdsTopic::skeleton);
  dds_entity_t statuses = daemon::make_reader(dds.participant(), dds.subscriber(), DdsTopic::status);
  dds_entity_t events = daemon::make_reader(dds.participant(), dds.subscriber(), DdsTopic::event);
  dds_entity_t replies = daemon::make_reader(dds.participant(), dds.subscriber(), DdsTopic::reply);
  dds_entity_t commands = daemon::make_writer(dds.participant(), dds.publisher(), DdsTopic::command);
  std::uint64_t last_skeleton = 0, last_event = 0, id = 0, answered = 0;
  Clock::time_point next_command = Clock::now();
  booth_msg_Command asking{};

  template <class T, class F>
  void take_all(dds_entity_t reader, F look) {
    while (take<T>(reader, look, 0ms))
      ;
  }

  void turn() {
    take_all<booth_msg_Skeleton>(skeletons, [&](const booth_msg_Skeleton& s) {
      ++board.heard;
      board.late_us += (monotonic_ns() - s.publish_monotonic_ns) / 1000;
      board.backwards += s.serial_number <= last_skeleton;
      last_skeleton = s.serial_number;
    });
    take_all<booth_msg_Event>(events, [&](const booth_msg_Event& e) {
      ++board.events_heard;
      board.event_gaps += last_event != 0 && e.serial_number != last_event + 1;
      last_event = e.serial_number;
    });
    take_all<booth_msg_Status>(statuses, [&](const auto&) { ++board.statuses; });
    take_all<booth_msg_Reply>(replies, [&](const booth_msg_Reply& r) {
      if (r.id != id || answered == id) return;
      answered = id;
      ++board.replies;
    });
    dds_liveliness_changed_status_t status{};
    dds_get_liveliness_changed_status(skeletons, &status);
    board.alive = status.alive_count > 0;
    // A command a second; the same again until it is answered, as the guide says.
    if (Clock::now() < next_command || !board.alive) return;
    next_command = Clock::now() + 1s;
    if (answered == id) {
      asking = command("net", "console", ++id, booth_msg_COMMAND_START);
      ++board.asked;
    }
    dds_write(commands, &asking);
  }
};

/// A child in a network of its own, with its cables sent to us.
class Host {
 public:
  Host(Board& board, const std::vector<std::string>& addresses, const std::function<void()>& work) {
    int pair[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM, 0, pair) != 0) return;
    pid_ = ::fork();
    if (pid_ == 0) {
      ::close(pair[0]);
      try {
        if (const std::string why = enter_own_network(); !why.empty()) throw std::runtime_error(why);
        for (std::size_t i = 0; i < addresses.size(); ++i) send_descriptor(pair[1], open_cable("cable" + std::to_string(i), addresses[i]));
        ::close(pair[1]);
        work();
      } catch (const std::exception& e) {
        fail(board, e.what());
      }
      ::_exit(0);
    }
    ::close(pair[1]);
    for (std::size_t i = 0; i < addresses.size(); ++i) cables.push_back(receive_descriptor(pair[0]));
    ::close(pair[0]);
  }
  ~Host() {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  std::vector<int> cables;

 private:
  pid_t pid_ = -1;
};

struct NetworkFault : ::testing::Test {
  Board* board = nullptr;
  void SetUp() override {
    // Whether it is permitted is tried in a child: there is no way back out of a namespace.
    void* memory = ::mmap(nullptr, sizeof(Board), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    ASSERT_NE(memory, MAP_FAILED);
    board = new (memory) Board;
    {
      const Host trial(*board, {"10.99.0.9"}, [] {});
      for (const int fd : trial.cables)
        if (fd >= 0) ::close(fd);
    }
    if (board->failed) GTEST_SKIP() << "skipped: " << board->why;
  }
  void TearDown() override {
    EXPECT_FALSE(board->failed) << board->why;
    ::munmap(board, sizeof(Board));
  }
};

TEST_F(NetworkFault, ABadCableStopsNeitherBoothNorConsole) {
  const char* text = std::getenv("BOOTHD_CUT_SECONDS");
  const auto cut_time = std::chrono::seconds(text ? std::atoi(text) : 3);
  const Host booth(*board, {"10.99.0.1"}, [&] { be_the_booth(*board); });
  const Host console(*board, {"10.99.0.2"}, [&] {
    Console ear{*board};
    while (!board->end && ::getppid() != 1) {
      ear.turn();
      std::this_thread::sleep_for(1ms);
    }
  });
  FaultyWire wire(booth.cables.at(0), console.cables.at(0));
  ASSERT_TRUE(eventually([&] { return board->heard > 30 && board->statuses > 0 && board->replies > 0; }, 60s)) << board->why;

  const auto phase = [&](const char* name, std::chrono::milliseconds time) {
    const std::uint64_t published = board->published, heard = board->heard, events = board->event_gaps, replies = board->replies;
    const std::int64_t late = board->late_us;
    board->longest_call_us = 0;
    std::this_thread::sleep_for(time);
    const auto sent = board->published - published, got = board->heard - heard;
    std::cout << name << ": " << sent << " published, " << got << " heard (" << (sent ? 100 * got / sent : 0) << " %), "
              << (got ? static_cast<double>(board->late_us - late) / 1000.0 / static_cast<double>(got) : 0.0) << " ms late on average, "
              << board->event_gaps - events << " gaps in events, " << board->replies - replies << " replies, longest call " << board->longest_call_us
              << " us\n";
    // At 30 a second; a writer that waits for the network publishes next to nothing. Half is for busy machines.
    EXPECT_GE(sent, static_cast<std::uint64_t>(15 * time.count() / 1000)) << name;
    return std::array<double, 2>{sent ? static_cast<double>(got) / static_cast<double>(sent) : 0,
                                 got ? static_cast<double>(board->late_us - late) / 1e3 / static_cast<double>(got) : 0};
  };
  phase("clean", 2s);

  wire.loss = 0.05;
  const auto lossy = phase("loss 5 %", 4s);
  EXPECT_GT(wire.lost(), 0u);
  EXPECT_GT(lossy[0], 0.5);
  wire.loss = 0;

  wire.reorder = 0.2;
  phase("reordered 20 %", 3s);
  EXPECT_GT(wire.late(), 0u);
  wire.reorder = 0;

  wire.delay_ms = 200;
  std::this_thread::sleep_for(500ms);
  const auto delayed = phase("delay 200 ms", 3s);
  EXPECT_GT(delayed[0], 0.5);
  EXPECT_GE(delayed[1], 195);
  wire.delay_ms = 0;
  EXPECT_EQ(board->backwards, 0u) << "a reader never sees an older skeleton after a newer one";
  EXPECT_EQ(board->event_gaps, 0u) << "events are repeated until they arrive";

  const std::uint64_t events_before = board->events;
  wire.cut = true;
  phase("cut", cut_time);
  EXPECT_FALSE(board->alive) << "liveliness tells that the booth is out of reach";
  wire.cut = false;
  const auto healed = Clock::now();
  const std::uint64_t heard = board->heard;
  ASSERT_TRUE(eventually([&] { return board->heard > heard + 5 && board->alive; }, 90s)) << "the console hears again";
  std::cout << "after a cut of " << cut_time.count() << " s the console hears again after "
            << std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - healed).count() << " ms\n";
  const std::uint64_t replies = board->replies;
  EXPECT_TRUE(eventually([&] { return board->replies > replies; }, 60s)) << "commands are answered again";
  EXPECT_LE(board->commands, board->asked) << "each was carried out once";
  std::cout << board->asked << " commands asked, " << board->commands << " carried out, " << board->replies
            << " answered; gaps in events over the cut: " << board->event_gaps << " of " << board->events - events_before << " sent\n";
  board->end = true;
}

TEST_F(NetworkFault, OfTwoNetworksOnlyTheConfiguredOneIsUsed) {
  const Host booth(*board, {"10.99.0.1", "10.98.0.1"}, [&] { be_the_booth(*board); });
  const Host console(*board, {"10.99.0.2"}, [&] {
    Console ear{*board};
    while (!board->end && ::getppid() != 1) {
      ear.turn();
      std::this_thread::sleep_for(1ms);
    }
  });
  const FaultyWire wire(booth.cables.at(0), console.cables.at(0));
  EXPECT_TRUE(eventually([&] { return board->heard > 10 && board->statuses > 0; }, 60s));
  std::this_thread::sleep_for(500ms);
  std::uint64_t udp = 0;
  std::uint8_t bytes[2048];
  for (ssize_t n = 0; (n = ::read(booth.cables.at(1), bytes, sizeof bytes)) > 0;) udp += is_udp(bytes, static_cast<std::size_t>(n));
  EXPECT_EQ(udp, 0u) << "nothing of DDS goes out on the other network";
  ::close(booth.cables.at(1));
  board->end = true;
}

}  // namespace
}  // namespace booth::tests

// The table of messages, and what arrives at a planted journal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <set>
#include <thread>

#include "daemon/health/messages.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;

TEST(Messages, TheTableIsWhole) {
  std::set<std::string_view> ids, names;
  std::size_t n = 0;
  for (const MessageEntry& m : messages()) {
    EXPECT_EQ(static_cast<std::size_t>(m.message), n++) << m.name;
    EXPECT_EQ(&entry_of(m.message), &m);
    EXPECT_EQ(m.id.size(), 32u) << m.name;
    EXPECT_EQ(m.id.find_first_not_of("0123456789abcdef"), std::string_view::npos) << m.name;
    EXPECT_TRUE(ids.insert(m.id).second) << m.name << " has the id of another";
    EXPECT_TRUE(names.insert(m.name).second) << m.name;
    EXPECT_FALSE(m.meaning.empty() || m.remedy.empty()) << m.name;
    for (const auto& text : {m.name, m.meaning, m.remedy}) EXPECT_EQ(text.find('|'), std::string_view::npos) << "would break the page's table: " << text;
  }
  EXPECT_EQ(n, static_cast<std::size_t>(Message::newer_file) + 1);
}

/// A socket where the journal's would be.
struct PlantedJournal {
  PlantedJournal() : fd(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    EXPECT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    set_journal(path);
  }
  ~PlantedJournal() {
    set_journal({});
    ::close(fd);
  }
  std::string next() const {
    pollfd wait{fd, POLLIN, 0};
    char bytes[4096];
    if (::poll(&wait, 1, 10'000) != 1) return "nothing came";
    const auto n = ::recv(fd, bytes, sizeof bytes, 0);
    return n < 0 ? "recv failed" : std::string(bytes, static_cast<std::size_t>(n));
  }
  tests::TemporaryFolder folder;
  const std::string path = (folder.path / "journal").string();
  const int fd;
};

TEST(Messages, ReachTheJournalWithTheirId) {
  const PlantedJournal journal;
  log_message(LogLevel::warning, Message::camera_lost, "camera front-left is lost");
  EXPECT_EQ(journal.next(), "MESSAGE=camera front-left is lost\nMESSAGE_ID=" + std::string(entry_of(Message::camera_lost).id) +
                                "\nPRIORITY=4\nSYSLOG_IDENTIFIER=daemon_messages_test\n");
}

TEST(Messages, NoTextForgesAField) {
  const PlantedJournal journal;
  log_message(LogLevel::error, Message::camera_lost, "a\nPRIORITY=7\nMESSAGE_ID=0");
  EXPECT_THAT(journal.next(), HasSubstr("MESSAGE=a PRIORITY=7 MESSAGE_ID=0\n"));
}

TEST(Messages, TheLastOneIsTakenBeforeTheProcessEnds) {
  const PlantedJournal journal;
  std::atomic<bool> looked = false;
  std::string came;
  std::jthread slow([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    looked = true;
    came = journal.next();
  });
  log_last_message(LogLevel::error, Message::configuration_wrong, "boothd.toml:1: booth.id");
  EXPECT_TRUE(looked);
  slow.join();
  EXPECT_THAT(came, HasSubstr("MESSAGE=boothd.toml:1: booth.id\n"));
}

TEST(Messages, NobodyWaitsForAJournalThatHangs) {
  const PlantedJournal journal;
  log_last_message(LogLevel::error, Message::internal_fault, "nobody reads this in time");
  EXPECT_THAT(journal.next(), HasSubstr("nobody reads this in time"));
}

TEST(Messages, GoToStderrWhereNoJournalTakesThem) {
  testing::internal::CaptureStderr();
  set_journal({});
  log_message(LogLevel::error, Message::internal_fault, "first");
  set_journal("/nonexistent/journal");
  log_message(LogLevel::error, Message::internal_fault, "second");
  set_journal("/nonexistent/" + std::string(200, 'x'));
  log_message(LogLevel::error, Message::internal_fault, "third");
  set_journal({});
  log_message(LogLevel::debug, Message::internal_fault, "less important than the level");
  EXPECT_THAT(testing::internal::GetCapturedStderr(), ::testing::MatchesRegex("[^\n]*first\n[^\n]*second\n[^\n]*third\n"));
}

}  // namespace
}  // namespace booth::daemon

// Commands from the network that are old, copied, malformed or too many: what is carried out, what is answered, what is not even answered.
#include "daemon/dds/command_guard.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

constexpr std::int64_t kUtc = 1'800'000'000'000'000'000, kSecond = 1'000'000'000;

struct CommandGuardTest : ::testing::Test {
  int carried_out = 0;
  std::int64_t utc = kUtc;
  hal::MonotonicTime now{1000s};
  CommandGuard guard{1, now,
                     [this](DdsCommand) {
                       ++carried_out;
                       return DdsAnswer{.accepted = true, .state = 1};
                     },
                     [] { return std::uint8_t{3}; }};

  void pass(std::chrono::nanoseconds time) {
    now += time;
    utc += time.count();
  }
  RemoteCommand command(std::uint64_t id, std::uint32_t kind = 0) {
    return {.writer = 7, .version = 1, .sender = "console", .id = id, .utc_ns = utc, .kind = kind};
  }
  auto send(const RemoteCommand& c) { return guard.handle(c, utc, now); }
};

TEST_F(CommandGuardTest, CarriesOutOnceAndRepeatsTheAnswer) {
  const RemoteCommand c = command(1);
  const auto first = send(c);
  ASSERT_TRUE(first);
  EXPECT_TRUE(first->answer.accepted);
  EXPECT_FALSE(first->repeated);
  pass(1s);
  const auto again = send(c);
  ASSERT_TRUE(again);
  EXPECT_TRUE(again->answer.accepted);
  EXPECT_TRUE(again->repeated);
  EXPECT_EQ(again->answer.state, 1) << "as it was then";
  RemoteCommand other = c;
  other.sender = "another";
  EXPECT_FALSE(send(other)->repeated) << "ids belong to their senders";
  EXPECT_EQ(carried_out, 2);
}

TEST_F(CommandGuardTest, AnIdIsNotUsedForTwoCommands) {
  send(command(1, 0));
  const auto second = send(command(1, 1));
  EXPECT_FALSE(second->answer.accepted);
  EXPECT_THAT(second->answer.text, HasSubstr("used this id"));
  EXPECT_EQ(carried_out, 1);
}

TEST_F(CommandGuardTest, ACopyIsHarmlessForAsLongAsItsTimeIsGood) {
  const RemoteCommand c = command(1);
  send(c);
  // The longest life of a copy: the original came with a clock 29 s ahead.
  RemoteCommand ahead = command(2);
  ahead.utc_ns += 29 * kSecond;
  EXPECT_TRUE(send(ahead)->answer.accepted);
  for (int s = 0; s < 65; ++s) {
    pass(1s);
    const auto one = send(c), two = send(ahead);
    ASSERT_TRUE(one && two);
    EXPECT_TRUE(one->repeated || !one->answer.accepted);
    EXPECT_TRUE(two->repeated || !two->answer.accepted);
  }
  EXPECT_EQ(carried_out, 2);
  EXPECT_THAT(send(c)->answer.text, HasSubstr("65 s behind"));
}

TEST_F(CommandGuardTest, RefusesWhatIsNotOfThisTime) {
  RemoteCommand c = command(1);
  c.utc_ns += 31 * kSecond;
  EXPECT_THAT(send(c)->answer.text, HasSubstr("31 s before"));
  c.utc_ns = utc - 1;
  EXPECT_THAT(send(c)->answer.text, HasSubstr("older than this run"));
  for (const std::int64_t time : {std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max(), std::int64_t{0}}) {
    pass(10s);
    c.utc_ns = time;
    EXPECT_FALSE(send(c)->answer.accepted);
  }
  EXPECT_EQ(send(c)->answer.state, 3) << "a refusal tells the state, too";
  EXPECT_EQ(carried_out, 0);
}

TEST_F(CommandGuardTest, AClockThatIsSetBackOrForwardSilencesNobody) {
  // The battery of the board had the booth start ten years ahead; then the time server was heard.
  for (const std::int64_t leap : {-315'360'000 * kSecond, 630'720'000 * kSecond}) {
    pass(60s);
    utc += leap;
    EXPECT_TRUE(send(command(static_cast<std::uint64_t>(utc / kSecond)))->answer.accepted);
    RemoteCommand old = command(2);
    old.utc_ns = utc - 25 * kSecond;
    EXPECT_TRUE(send(old)->answer.accepted) << "it was sent to this run";
  }
  EXPECT_EQ(carried_out, 3) << "the last one's id had been used a minute before, and its answer was repeated";
}

TEST_F(CommandGuardTest, RefusesGarbage) {
  RemoteCommand c = command(1, 4);
  EXPECT_THAT(send(c)->answer.text, HasSubstr("not known"));
  c = command(2);
  c.version = 2;
  EXPECT_THAT(send(c)->answer.text, HasSubstr("version 1, not 2"));
  c = command(3);
  c.sender.clear();
  EXPECT_THAT(send(c)->answer.text, HasSubstr("sender"));
  EXPECT_EQ(carried_out, 0);
}

TEST_F(CommandGuardTest, AFloodIsNotAnsweredAndSilencesNobodyElse) {
  int answered = 0, heard = 0;
  for (int i = 0; i < 10'000; ++i) {
    pass(1ms);
    answered += send(command(static_cast<std::uint64_t>(i))).has_value();
    if (i % 2000 == 1999) {
      RemoteCommand honest = command(1'000'000 + static_cast<std::uint64_t>(i));
      honest.writer = 8;
      honest.sender = "honest";
      heard += send(honest).has_value();
    }
  }
  EXPECT_LE(answered, CommandGuard::kBurst + 10 * CommandGuard::kPerSecond + 1);
  EXPECT_EQ(heard, 5);
  EXPECT_EQ(guard.ignored(), 10'000u - static_cast<unsigned>(answered));
}

TEST_F(CommandGuardTest, ManyWritersTogetherAreBounded) {
  int answered = 0;
  for (std::uint64_t i = 0; i < 10'000; ++i) {
    pass(1ms);
    RemoteCommand c = command(i);
    c.writer = i;
    c.sender = "writer " + std::to_string(i);
    answered += send(c).has_value();
  }
  EXPECT_LE(answered, CommandGuard::kAllBurst + 10 * CommandGuard::kAllPerSecond + 1);
  EXPECT_LE(carried_out, answered);
}

}  // namespace
}  // namespace booth::daemon

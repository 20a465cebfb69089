// Three weeks of a booth in simulated time: what a clock of seconds would never show, such as a limit that comes only after weeks or a watch that tires.
#include <gtest/gtest.h>

#include <random>

#include "daemon/health/progress_watch.hpp"
#include "daemon/session/session_machine.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using S = SessionState;
using E = SessionEvent;

constexpr auto kTick = 100ms;
constexpr auto kPatience = 10s;
constexpr SessionMachine::Limits kLimits{};

/// One booth, ten looks a second, a visitor about every half hour who comes, is lost now and then, goes, and presses or does not.
struct LongWatch {
  std::mt19937_64 random{7};
  SessionMachine machine{kLimits};
  ProgressWatch watch{kPatience};
  hal::MonotonicTime now{1000s}, began{}, finishing_since{};
  std::vector<std::uint64_t> counters{0, 0, 0, 0};
  bool someone = false;
  int begun = 0, ended = 0, by_themselves = 0, stalls = 0;

  bool chance(double a_second) { return std::uniform_real_distribution(0.0, 1.0)(random) < a_second * 0.1; }

  void note(const SessionOutcome& o) {
    if (o.action == SessionAction::begin) {
      ASSERT_EQ(begun, ended) << "a session in a session";
      ++begun;
      began = now;
    }
    if (o.action == SessionAction::end) {
      ++ended;
      by_themselves += o.event != E::stop && o.event != E::toggle;
      finishing_since = now;
    }
  }

  void step() {
    now += kTick;
    for (auto& c : counters) c += 3;
    if (watch.stalled(counters, now.time_since_epoch()) >= 0) ++stalls;
    someone = someone ? !chance(1.0 / 120) : chance(1.0 / 1800);
    if (chance(someone ? 1.0 / 60 : 1.0 / 20000)) note(machine.handle(chance(5) ? E::toggle : E::start, now));
    if (machine.running()) note(machine.frame(someone, someone && (machine.body_known() || chance(0.2)), now));
    if (machine.state() == S::finishing && now - finishing_since > 2s) note(machine.handle(E::files_written, now));
    note(machine.tick(now, false));
    if (machine.running()) {
      ASSERT_LE(now - began, kLimits.session + kTick + kTick) << "no session outlives session.max_seconds";
    } else {
      ASSERT_EQ(begun, ended) << "none is left open";
    }
  }
};

TEST(LongWatch, ThreeWeeksLoseNothingAndTireNobody) {
  LongWatch booth;
  for (std::int64_t i = 0; i < 21 * 24 * 36000LL && !::testing::Test::HasFatalFailure(); ++i) booth.step();
  EXPECT_EQ(booth.stalls, 0) << "threads that move are never taken for hung";
  EXPECT_GT(booth.begun, 500);
  EXPECT_GT(booth.by_themselves, 200) << "people go without pressing";
  std::cout << booth.begun << " sessions in 21 days, " << booth.by_themselves << " ended by themselves\n";
  // After all that time a hang is noticed as at first.
  const auto hung = booth.now;
  booth.counters[0] += 3;  // the others stand still
  booth.counters[1] += 3;
  booth.counters[2] += 3;
  while (booth.watch.stalled(booth.counters, booth.now.time_since_epoch()) < 0 && booth.now - hung < 60s) {
    booth.now += kTick;
    for (std::size_t c = 0; c < 3; ++c) booth.counters[c] += 3;
  }
  EXPECT_EQ(booth.watch.stalled(booth.counters, booth.now.time_since_epoch()), 3);
  EXPECT_LE(booth.now - hung, kPatience + 2 * kTick);
}

}  // namespace
}  // namespace booth::daemon

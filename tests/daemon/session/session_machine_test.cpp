// Every state meets every event, and time does what the limits say.
#include <gtest/gtest.h>

#include <string>

#include "daemon/session/session_machine.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using S = SessionState;
using E = SessionEvent;
using A = SessionAction;

constexpr hal::MonotonicTime at(std::chrono::duration<double> t) { return hal::MonotonicTime(1000s) + std::chrono::round<hal::Nanoseconds>(t); }
constexpr SessionMachine::Limits kLimits{.lost = 500ms, .search = 60s, .session = 600s, .estimate = 100s, .pause = 30s, .countdown = 0s, .toggle_guard = 500ms};

TEST(SessionTable, SaysTheSameAsThisOne) {
  // One letter for the next state (i e t s f c, k for calibrating), '+' begins, '-' ends, '*' calibrates, '/' cancels that, '!' refuses. Columns: idle
  // estimating tracking searching finishing countdown calibrating.
  const struct {
    E event;
    const char* row;
  } rows[] = {
      {E::start, "c e! t! s! f! c! k!"},           {E::stop, "i! f- f- f- f i i/"},          {E::toggle, "c f- f- f- f! i i/"},
      {E::emergency_pressed, "i f- f- f- f i i/"}, {E::emergency_released, "i e t s f c k"}, {E::body_accepted, "i t t s f c k"},
      {E::person_lost, "i s s s f c k"},           {E::person_found, "i e t t f c k"},       {E::search_over, "i e t f- f c k"},
      {E::session_over, "i f- f- f- f c k"},       {E::sources_ended, "i f- f- f- f i i/"},  {E::files_written, "i e t s i c k"},
      {E::countdown_over, "i e t s f e+ k"},       {E::estimate_over, "i f- t s f c k"},     {E::pause_over, "i f- f- f- f c k"},
      {E::calibrate, "k* e! t! s! f! c! k!"},      {E::calibration_over, "i e t s f c i"},
  };
  ASSERT_EQ(std::size(rows), static_cast<std::size_t>(kSessionEvents));
  for (const auto& [event, expected] : rows) {
    std::string row;
    for (int s = 0; s < kSessionStates; ++s) {
      const SessionOutcome o = session_transition(static_cast<S>(s), event);
      EXPECT_EQ(o.event, event);
      row += (s ? " " : "") + std::string(1, o.to == S::calibrating ? 'k' : to_string(o.to)[0]);
      if (o.action == A::begin) row += '+';
      if (o.action == A::end) row += '-';
      if (o.action == A::calibrate) row += '*';
      if (o.action == A::cancel_calibration) row += '/';
      if (!o.refusal.empty()) row += '!';
    }
    EXPECT_EQ(row, expected) << to_string(event);
  }
}

TEST(SessionMachine, AWholeSession) {
  SessionMachine m(kLimits);
  EXPECT_EQ(m.handle(E::start, at(0s)).action, A::begin);
  EXPECT_EQ(m.frame(true, false, at(0.1s)).to, S::estimating);
  EXPECT_EQ(m.frame(true, true, at(1s)).to, S::tracking);
  EXPECT_FALSE(m.frame(false, false, at(1.4s)).changed()) << "a blink is no loss";
  EXPECT_EQ(m.frame(false, false, at(1.5s)).to, S::searching);
  EXPECT_EQ(m.frame(true, false, at(3s)).to, S::tracking) << "the body is known";
  EXPECT_EQ(m.handle(E::stop, at(4s)).action, A::end);
  EXPECT_EQ(m.state(), S::finishing);
  EXPECT_EQ(m.handle(E::start, at(4.1s)).refusal, "the last session is still being saved; try again in a moment");
  EXPECT_EQ(m.handle(E::files_written, at(5s)).to, S::idle);
  EXPECT_TRUE(m.handle(E::start, at(6s)).refusal.empty());
  EXPECT_FALSE(m.body_known()) << "a new session is a new person";
}

TEST(SessionMachine, FoundBeforeTheBodyIsKnownMeansEstimating) {
  SessionMachine m(kLimits);
  m.handle(E::start, at(0s));
  EXPECT_EQ(m.frame(false, false, at(0.5s)).to, S::searching) << "nobody came";
  EXPECT_EQ(m.frame(true, false, at(5s)).to, S::estimating);
}

TEST(SessionMachine, StartWhileTrackingAndStopWhileIdleAreRefused) {
  SessionMachine m(kLimits);
  EXPECT_EQ(m.handle(E::stop, at(0s)).refusal, "no session is running");
  m.handle(E::start, at(0s));
  m.frame(true, true, at(1s));
  const SessionOutcome again = m.handle(E::start, at(2s));
  EXPECT_EQ(again.refusal, "a session is running already");
  EXPECT_FALSE(again.changed());
  EXPECT_EQ(again.action, A::none);
}

TEST(SessionMachine, ABouncingButtonIsOnePress) {
  SessionMachine m(kLimits);
  EXPECT_EQ(m.handle(E::toggle, at(0s)).to, S::estimating);
  for (int i = 1; i <= 20; ++i) EXPECT_FALSE(m.handle(E::toggle, at(i * 100ms)).refusal.empty()) << i;
  EXPECT_EQ(m.state(), S::estimating) << "however long it bounces";
  EXPECT_EQ(m.handle(E::toggle, at(2s + 500ms)).to, S::finishing);
}

TEST(SessionMachine, EmergencyEndsLatchesAndStartsNothing) {
  SessionMachine m(kLimits);
  m.handle(E::start, at(0s));
  EXPECT_EQ(m.handle(E::emergency_pressed, at(1s)).action, A::end);
  m.handle(E::files_written, at(2s));
  for (const E e : {E::start, E::toggle}) {
    const SessionOutcome o = m.handle(e, at(3s));
    EXPECT_EQ(o.refusal, "the emergency stop is pressed; release it first");
    EXPECT_EQ(o.to, S::idle);
    EXPECT_EQ(o.action, A::none);
  }
  EXPECT_EQ(m.handle(E::emergency_released, at(4s)).to, S::idle) << "releasing starts nothing";
  EXPECT_EQ(m.handle(E::start, at(5s)).to, S::estimating);
}

TEST(SessionMachine, TimeEndsASession) {
  SessionMachine m(kLimits);
  m.handle(E::start, at(0s));
  m.frame(true, true, at(599s));
  EXPECT_FALSE(m.tick(at(599.4s), false).changed());
  EXPECT_EQ(m.tick(at(600s), false).action, A::end);
}

TEST(SessionMachine, ASearchEndsAfterItsLimitButNotWhilePaused) {
  SessionMachine m(kLimits);
  m.handle(E::start, at(0s));
  m.frame(true, true, at(1s));
  m.frame(false, false, at(2s));
  ASSERT_EQ(m.state(), S::searching);
  EXPECT_FALSE(m.tick(at(50s), true).changed()) << "no cameras: nobody could have been seen";
  EXPECT_FALSE(m.tick(at(109s), false).changed());
  const SessionOutcome o = m.tick(at(110s), false);
  EXPECT_EQ(o.action, A::end);
  EXPECT_EQ(o.from, S::searching);
}

TEST(SessionMachine, NoFramesAtAllIsALoss) {
  SessionMachine m(kLimits);
  m.handle(E::start, at(0s));
  EXPECT_FALSE(m.tick(at(0.9s), false).changed());
  m.frame(true, true, at(1s));
  EXPECT_FALSE(m.tick(at(2.9s), false).changed());
  EXPECT_EQ(m.tick(at(3s), false).to, S::searching);
}

TEST(SessionMachine, APauseEndsASessionAfterItsLimit) {
  SessionMachine m(kLimits);
  m.handle(E::start, at(0s));
  m.frame(true, true, at(1s));
  EXPECT_FALSE(m.tick(at(2s), true).changed());
  EXPECT_FALSE(m.tick(at(31.9s), true).changed());
  EXPECT_FALSE(m.tick(at(32s), false).changed()) << "a camera came back just in time";
  EXPECT_FALSE(m.tick(at(33s), true).changed()) << "and the next pause counts from its own beginning";
  const SessionOutcome o = m.tick(at(63s), true);
  EXPECT_EQ(o.event, E::pause_over);
  EXPECT_EQ(o.action, A::end);
}

TEST(SessionMachine, ABodyThatIsNotFoundEndsTheSessionAndPausesDoNotCount) {
  SessionMachine m(kLimits);
  m.handle(E::start, at(0s));
  for (int t = 1; t <= 99; ++t) {
    ASSERT_FALSE(m.frame(true, false, at(t * 1s)).changed());
    ASSERT_FALSE(m.tick(at(t * 1s), false).changed()) << t;
  }
  for (int t = 100; t <= 120; ++t) ASSERT_FALSE(m.tick(at(t * 1s), true).changed()) << t;
  const SessionOutcome o = m.tick(at(121s), false);
  EXPECT_EQ(o.event, E::estimate_over);
  EXPECT_EQ(o.action, A::end);
}

TEST(SessionMachine, ACountdownBeginsTheSessionInItsTimeAndCanBeCancelled) {
  SessionMachine::Limits limits = kLimits;
  limits.countdown = 5s;
  SessionMachine m(limits);
  const SessionOutcome pressed = m.handle(E::toggle, at(0s));
  EXPECT_EQ(pressed.to, S::countdown);
  EXPECT_EQ(pressed.action, A::none);
  EXPECT_EQ(m.countdown_left(at(0s)), 5);
  EXPECT_EQ(m.countdown_left(at(0.1s)), 5);
  EXPECT_EQ(m.countdown_left(at(4.9s)), 1);
  EXPECT_FALSE(m.tick(at(4.9s), false).changed());
  const SessionOutcome begun = m.tick(at(5s), false);
  EXPECT_EQ(begun.event, E::countdown_over);
  EXPECT_EQ(begun.action, A::begin);
  EXPECT_EQ(begun.to, S::estimating);
  EXPECT_EQ(m.countdown_left(at(5s)), 0);

  for (const E cancel : {E::toggle, E::stop, E::emergency_pressed, E::sources_ended}) {
    SessionMachine n(limits);
    n.handle(E::start, at(0s));
    const SessionOutcome o = n.handle(cancel, at(1s));
    EXPECT_EQ(o.to, S::idle) << to_string(cancel);
    EXPECT_EQ(o.action, A::none) << "nothing was captured, so nothing is saved";
    EXPECT_FALSE(n.tick(at(6s), false).changed()) << to_string(cancel);
  }
}

TEST(SessionMachine, ACountdownOfNoLengthIsOverAtOnceAndTheCauseIsThePress) {
  SessionMachine m(kLimits);
  const SessionOutcome o = m.handle(E::start, at(0s));
  EXPECT_EQ(o.from, S::idle);
  EXPECT_EQ(o.to, S::estimating);
  EXPECT_EQ(o.action, A::begin);
  EXPECT_EQ(o.event, E::start);
}

/// Every sequence of so many steps from a set of them, and after each step what must hold whatever came before.
struct Explorer {
  struct Book {
    bool open = false, latched = false;  ///< a session was begun and not ended; the emergency stop is pressed
  };
  static constexpr int kSteps = kSessionEvents + 5, kDepth = 4;
  std::uint64_t seen = 0;

  static SessionOutcome step(SessionMachine& m, int s, hal::MonotonicTime now) {
    if (s < kSessionEvents) return m.handle(static_cast<E>(s), now);
    if (s == kSessionEvents) return m.frame(true, true, now);
    if (s == kSessionEvents + 1) return m.frame(true, false, now);
    if (s == kSessionEvents + 2) return m.frame(false, false, now);
    return m.tick(now, s == kSessionEvents + 4);
  }

  void explore(const SessionMachine& from, Book book, hal::MonotonicTime now, int depth) {
    for (int s = 0; s < kSteps && !::testing::Test::HasFailure(); ++s) {
      // Short and long waits, so that every limit is met on either side.
      for (const auto wait : {std::chrono::milliseconds(100), std::chrono::milliseconds(70'000)}) {
        SessionMachine m = from;
        const SessionOutcome o = step(m, s, now + wait);
        ++seen;
        Book b = book;
        if (s == static_cast<int>(E::emergency_pressed)) b.latched = true;
        if (s == static_cast<int>(E::emergency_released)) b.latched = false;
        ASSERT_EQ(o.from, from.state());
        ASSERT_EQ(o.to, m.state());
        ASSERT_EQ(m.latched(), b.latched);
        if (o.action == A::begin) {
          ASSERT_FALSE(b.open) << "a session in a session";
          ASSERT_FALSE(b.latched) << "begun with the emergency stop pressed";
          b.open = true;
        }
        if (o.action == A::end) {
          ASSERT_TRUE(b.open) << "ended what was not begun";
          ASSERT_EQ(o.to, S::finishing);
          b.open = false;
        }
        ASSERT_EQ(b.open, m.running()) << to_string(o.from) << " -> " << to_string(o.to) << " by " << to_string(o.event);
        ASSERT_EQ(o.action == A::calibrate, o.from != S::calibrating && o.to == S::calibrating);
        if (o.action == A::cancel_calibration) {
          ASSERT_EQ(o.from, S::calibrating);
          ASSERT_EQ(o.to, S::idle);
        }
        if (!o.refusal.empty()) {
          ASSERT_FALSE(o.changed());
          ASSERT_EQ(o.action, A::none);
        }
        if (b.latched) {
          ASSERT_FALSE(m.running());
          ASSERT_NE(m.state(), S::countdown);
          ASSERT_NE(m.state(), S::calibrating);
        }
        if (depth > 1) explore(m, b, now + wait, depth - 1);
      }
    }
  }
};

TEST(SessionMachine, EverySequenceOfFourStepsKeepsItsPromises) {
  for (const auto countdown : {0s, 5s}) {
    SessionMachine::Limits limits = kLimits;
    limits.countdown = countdown;
    Explorer explorer;
    explorer.explore(SessionMachine(limits), {}, at(0s), Explorer::kDepth);
    EXPECT_GT(explorer.seen, 2'000'000u);
  }
}

TEST(SessionMachine, IdleIgnoresFramesAndTime) {
  SessionMachine m(kLimits);
  EXPECT_FALSE(m.frame(true, true, at(1s)).changed());
  EXPECT_FALSE(m.tick(at(1e6s), false).changed());
}

}  // namespace
}  // namespace booth::daemon

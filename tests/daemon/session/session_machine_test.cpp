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
constexpr SessionMachine::Limits kLimits{.lost = 500ms, .search = 60s, .session = 600s, .toggle_guard = 500ms};

TEST(SessionTable, SaysTheSameAsThisOne) {
  // One letter for the next state (i e t s f), '+' begins, '-' ends, '!' refuses. Columns: idle estimating tracking searching finishing.
  const struct {
    E event;
    const char* row;
  } rows[] = {
      {E::start, "e+ e! t! s! f!"},         {E::stop, "i! f- f- f- f"},        {E::toggle, "e+ f- f- f- f!"},      {E::emergency_pressed, "i f- f- f- f"},
      {E::emergency_released, "i e t s f"}, {E::body_accepted, "i t t s f"},   {E::person_lost, "i s s s f"},      {E::person_found, "i e t t f"},
      {E::search_over, "i e t f- f"},       {E::session_over, "i f- f- f- f"}, {E::sources_ended, "i f- f- f- f"}, {E::files_written, "i e t s i"},
  };
  ASSERT_EQ(std::size(rows), static_cast<std::size_t>(kSessionEvents));
  for (const auto& [event, expected] : rows) {
    std::string row;
    for (int s = 0; s < kSessionStates; ++s) {
      const SessionOutcome o = session_transition(static_cast<S>(s), event);
      row += (s ? " " : "") + std::string(1, to_string(o.to)[0]);
      if (o.action == A::begin) row += '+';
      if (o.action == A::end) row += '-';
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

TEST(SessionMachine, IdleIgnoresFramesAndTime) {
  SessionMachine m(kLimits);
  EXPECT_FALSE(m.frame(true, true, at(1s)).changed());
  EXPECT_FALSE(m.tick(at(1e6s), false).changed());
}

}  // namespace
}  // namespace booth::daemon

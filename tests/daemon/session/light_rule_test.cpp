// What the light says in every state with every trouble.
#include "daemon/session/light_rule.hpp"

#include <gtest/gtest.h>

namespace booth::daemon {
namespace {

using P = hal::LightPattern;
using S = SessionState;

TEST(LightRule, EachStateHasItsPattern) {
  EXPECT_EQ(light_of({.state = S::idle}).pattern, P::idle_steady);
  EXPECT_EQ(light_of({.state = S::countdown}).pattern, P::countdown_double_blink);
  EXPECT_EQ(light_of({.state = S::estimating}).pattern, P::estimating_fast_blink);
  EXPECT_EQ(light_of({.state = S::tracking}).pattern, P::tracking_on);
  EXPECT_EQ(light_of({.state = S::searching}).pattern, P::searching_slow_blink);
  EXPECT_EQ(light_of({.state = S::finishing}).pattern, P::saving_flash);
  EXPECT_EQ(light_of({.state = S::calibrating, .cue = CaptureCue::search}).pattern, P::searching_slow_blink);
  EXPECT_EQ(light_of({.state = S::calibrating, .cue = CaptureCue::hold_still}).pattern, P::estimating_fast_blink);
  EXPECT_EQ(light_of({.state = S::calibrating, .cue = CaptureCue::captured}).pattern, P::tracking_on);
}

TEST(LightRule, NoTroubleIsWithoutALightOfItsOwn) {
  for (int state = 0; state < kSessionStates; ++state)
    for (int bits = 0; bits < 32; ++bits) {
      const LightFacts facts{.state = static_cast<S>(state),
                             .latched = (bits & 1) != 0,
                             .paused = (bits & 2) != 0,
                             .degraded = (bits & 4) != 0,
                             .alarm = (bits & 8) != 0,
                             .panel = (bits & 16) != 0};
      const hal::LightShow show = light_of(facts);
      EXPECT_NE(show.pattern, P::off);
      EXPECT_EQ(show.pattern == P::fault_code, show.code > 0);
      EXPECT_EQ(bits != 0, show.degraded || show.pattern == P::fault_code) << state << " " << bits;
      // Whoever is being captured sees that, unless nothing can be captured.
      if ((facts.state == S::tracking || facts.state == S::estimating) && !facts.latched && !facts.paused) {
        EXPECT_NE(show.pattern, P::fault_code);
      }
    }
}

TEST(LightRule, TheWorstComesFirst) {
  LightFacts facts{.state = S::idle, .latched = true, .paused = true, .degraded = true, .alarm = true, .panel = true};
  EXPECT_EQ(light_of(facts).code, 1);
  facts.latched = false;
  EXPECT_EQ(light_of(facts).code, 2);
  facts.paused = false;
  EXPECT_EQ(light_of(facts).code, 3);
  facts.alarm = false;
  EXPECT_EQ(light_of(facts).code, 4);
  facts.panel = false;
  EXPECT_EQ(light_of(facts), (hal::LightShow{P::idle_steady, 0, true}));
}

}  // namespace
}  // namespace booth::daemon

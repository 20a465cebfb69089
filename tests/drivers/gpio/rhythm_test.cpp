// Each pattern of the light can be told from each other by eye, and says for how long it will stay as it is.
#include "drivers/gpio/rhythm.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>

namespace booth::drivers::gpio {
namespace {

using namespace std::chrono_literals;
using hal::LightPattern;
using hal::LightShow;

/// What the lamp does in ten milliseconds each.
std::string look(const LightShow& show, hal::Nanoseconds length) {
  std::string out;
  for (hal::Nanoseconds t{0}; t < length; t += 10ms) out += light_at(show, t).on ? '#' : '.';
  return out;
}

double lit(const std::string& picture) { return static_cast<double>(std::count(picture.begin(), picture.end(), '#')) / static_cast<double>(picture.size()); }

int flashes(const std::string& picture) {
  int out = 0;
  for (std::size_t i = 0; i < picture.size(); ++i) out += picture[i] == '#' && (i == 0 || picture[i - 1] == '.');
  return out;
}

TEST(Rhythm, LooksAsTheGuideSays) {
  EXPECT_EQ(lit(look({LightPattern::off}, 10s)), 0);
  EXPECT_EQ(lit(look({LightPattern::idle_steady}, 10s)), 1);
  EXPECT_EQ(flashes(look({LightPattern::estimating_fast_blink}, 10s)), 40);
  EXPECT_EQ(flashes(look({LightPattern::searching_slow_blink}, 10s)), 5);
  EXPECT_EQ(flashes(look({LightPattern::countdown_double_blink}, 10s)), 20);
  EXPECT_EQ(flashes(look({LightPattern::saving_flash}, 10s)), 10);
  EXPECT_NEAR(lit(look({LightPattern::tracking_on}, 10s)), 0.925, 0.01) << "on, with a wink every two seconds";
  EXPECT_EQ(flashes(look({LightPattern::tracking_on}, 10s)), 5);
}

TEST(Rhythm, AFaultCodeIsItsNumberOfBlinksAndAPause) {
  for (int code = 1; code <= 9; ++code) {
    const LightShow show{LightPattern::fault_code, code, false};
    const auto turn = code * 500ms + 1250ms;
    const std::string one = look(show, turn);
    EXPECT_EQ(flashes(one), code);
    EXPECT_EQ(look(show, 2 * turn), one + one);
    EXPECT_TRUE(one.ends_with(std::string(125, '.')));
  }
  EXPECT_EQ(look({LightPattern::fault_code, 0, false}, 5s), look({LightPattern::fault_code, 1, false}, 5s)) << "no code is no reason to be dark";
}

TEST(Rhythm, NoTwoLookAlike) {
  std::set<std::string> pictures;
  int shows = 0;
  for (const auto pattern : {LightPattern::off, LightPattern::idle_steady, LightPattern::countdown_double_blink, LightPattern::estimating_fast_blink,
                             LightPattern::tracking_on, LightPattern::searching_slow_blink, LightPattern::saving_flash})
    for (const bool degraded : {false, true}) {
      if (pattern == LightPattern::off && degraded) continue;
      pictures.insert(look({pattern, 0, degraded}, 12s));
      ++shows;
    }
  for (int code = 1; code <= 9; ++code, ++shows) pictures.insert(look({LightPattern::fault_code, code, false}, 12s));
  EXPECT_EQ(pictures.size(), static_cast<std::size_t>(shows));
}

TEST(Rhythm, DegradedFlickersEveryFewSecondsAndThePatternGoesOn) {
  const std::string plain = look({LightPattern::estimating_fast_blink}, 5s), both = look({LightPattern::estimating_fast_blink, 0, true}, 11'200ms);
  EXPECT_EQ(both.substr(0, 500), plain);
  EXPECT_EQ(flashes(both.substr(500, 60)), 6);
  EXPECT_EQ(both.substr(560, 500), plain);
  EXPECT_GE(flashes(look({LightPattern::idle_steady, 0, true}, 5600ms)), 6);
}

TEST(Rhythm, StaysAsItIsForAsLongAsItSays) {
  for (const auto pattern : {LightPattern::countdown_double_blink, LightPattern::estimating_fast_blink, LightPattern::tracking_on,
                             LightPattern::searching_slow_blink, LightPattern::saving_flash, LightPattern::fault_code})
    for (const bool degraded : {false, true}) {
      const LightShow show{pattern, 3, degraded};
      for (hal::Nanoseconds t{0}; t < 12s;) {
        const Moment m = light_at(show, t);
        ASSERT_GT(m.left, 0ns);
        ASSERT_LE(m.left, 5s);
        ASSERT_EQ(light_at(show, t + m.left - 1ns).on, m.on);
        t += m.left;
      }
    }
  EXPECT_EQ(light_at({LightPattern::idle_steady}, 7s).left, hal::Nanoseconds::max());
}

TEST(Rhythm, SoundsEnd) {
  for (const auto sound : {hal::Sound::accepted, hal::Sound::refused, hal::Sound::countdown, hal::Sound::found, hal::Sound::ended}) {
    EXPECT_TRUE(sound_at(sound, 0ns).on);
    hal::Nanoseconds t{0};
    int beats = 0;
    while (sound_at(sound, t).left != hal::Nanoseconds::max() && beats < 100) {
      t += sound_at(sound, t).left;
      ++beats;
    }
    EXPECT_LT(beats, 10);
    EXPECT_FALSE(sound_at(sound, t).on);
    EXPECT_LE(t, 1s);
  }
}

}  // namespace
}  // namespace booth::drivers::gpio

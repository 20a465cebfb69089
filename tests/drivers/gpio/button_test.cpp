// What edges come to: presses once, spikes never, late readers like punctual ones, stuck and chattering buttons by name.
#include "drivers/gpio/button.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace booth::drivers::gpio {
namespace {

using namespace std::chrono_literals;

constexpr hal::MonotonicTime at(std::chrono::microseconds t) { return hal::MonotonicTime(1000s) + t; }

Button button(hal::Nanoseconds stuck = 0ns) {
  Button b({.debounce = 20ms, .stuck = stuck, .edges_per_second = 200});
  b.begin(false, at(0us));
  return b;
}

TEST(Button, ACleanPressCountsOnceItHasSettledAndAsOfItsEdge) {
  Button b = button();
  EXPECT_FALSE(b.edge(true, at(1000ms)));
  EXPECT_EQ(b.next(), at(1020ms));
  EXPECT_FALSE(b.tick(at(1019ms)));
  const auto change = b.tick(at(1020ms));
  ASSERT_TRUE(change);
  EXPECT_TRUE(change->active);
  EXPECT_EQ(change->at, at(1000ms));
  EXPECT_FALSE(b.tick(at(1021ms))) << "once";
  EXPECT_EQ(b.next(), hal::MonotonicTime::max());
}

TEST(Button, ABouncingPressIsOnePressAsOfItsFirstEdge) {
  Button b = button();
  for (int i = 0; i <= 10; ++i) EXPECT_FALSE(b.edge(i % 2 == 0, at(1000ms + i * 3ms)));
  EXPECT_FALSE(b.tick(at(1049ms)));
  const auto change = b.tick(at(1050ms));
  ASSERT_TRUE(change);
  EXPECT_TRUE(change->active);
  EXPECT_EQ(change->at, at(1000ms));
}

TEST(Button, ASpikeIsNothing) {
  Button b = button();
  EXPECT_FALSE(b.edge(true, at(1000ms)));
  EXPECT_FALSE(b.edge(false, at(1005ms)));
  EXPECT_FALSE(b.tick(at(2000ms)));
  EXPECT_FALSE(b.active());
}

TEST(Button, TwoEdgesThatSayTheSameAreTheLevelThatTheySay) {
  Button b = button();
  b.edge(true, at(1000ms));
  b.edge(true, at(1001ms));  // the fall between them was too short to be read
  const auto change = b.tick(at(1021ms));
  ASSERT_TRUE(change);
  EXPECT_TRUE(change->active);
}

TEST(Button, WhoReadsAllEdgesLateHearsTheSamePresses) {
  std::mt19937 random(7);
  for (int round = 0; round < 200; ++round) {
    // Presses with bounces, and moments at which somebody looks.
    std::vector<std::pair<bool, hal::MonotonicTime>> edges;
    std::chrono::microseconds t = 1000ms;
    const int presses = 1 + static_cast<int>(random() % 4);
    for (int p = 0; p < 2 * presses; ++p) {
      const bool level = p % 2 == 0;
      const int bounces = static_cast<int>(random() % 5);
      for (int i = 0; i < bounces; ++i) {
        edges.emplace_back(level, at(t));
        t += std::chrono::microseconds(100 + random() % 4000);
        edges.emplace_back(!level, at(t));
        t += std::chrono::microseconds(100 + random() % 4000);
      }
      edges.emplace_back(level, at(t));
      t += std::chrono::microseconds(25'000 + random() % 400'000);
    }
    const auto listen = [&](bool punctual) {
      Button b = button();
      std::vector<ButtonChange> heard;
      const auto hear = [&](std::optional<ButtonChange> change) {
        if (change) heard.push_back(*change);
      };
      for (const auto& [level, when] : edges) {
        if (punctual)
          while (b.next() < when) hear(b.tick(b.next()));
        hear(b.edge(level, when));
      }
      hear(b.tick(at(t)));
      return heard;
    };
    const auto punctual = listen(true), late = listen(false);
    ASSERT_EQ(punctual.size(), static_cast<std::size_t>(2 * presses));
    ASSERT_EQ(late.size(), punctual.size());
    for (std::size_t i = 0; i < late.size(); ++i) {
      EXPECT_EQ(late[i].active, i % 2 == 0);
      EXPECT_EQ(late[i].at, punctual[i].at);
    }
  }
}

TEST(Button, PressedFromTheBeginningIsNoPress) {
  Button b({.debounce = 20ms, .stuck = 30s, .edges_per_second = 200});
  b.begin(true, at(0us));
  EXPECT_FALSE(b.tick(at(10s)));
  EXPECT_TRUE(b.active());
  b.edge(false, at(11s));
  EXPECT_FALSE(b.tick(at(12s))->active);
  b.edge(true, at(13s));
  EXPECT_TRUE(b.tick(at(14s))->active);
}

TEST(Button, StuckAfterItsTimeAndFreeAgainWhenLetGo) {
  Button b = button(30s);
  b.edge(true, at(1s));
  b.tick(at(2s));
  EXPECT_FALSE(b.stuck(at(30s)));
  EXPECT_TRUE(b.stuck(at(31s)));
  b.edge(false, at(40s));
  b.tick(at(41s));
  EXPECT_FALSE(b.stuck(at(100s)));
}

TEST(Button, WithoutALimitNothingIsStuck) {
  Button b = button(0ns);
  b.edge(true, at(1s));
  b.tick(at(2s));
  EXPECT_FALSE(b.stuck(at(1'000'000s)));
}

TEST(Button, ChattersBeyondWhatAPersonCanDo) {
  Button b = button();
  for (int i = 0; i < 200; ++i) b.edge(i % 2 == 0, at(1s + i * 4ms));
  EXPECT_FALSE(b.chatters()) << "a worn button pressed in a hurry";
  for (int i = 0; i < 100; ++i) b.edge(i % 2 == 0, at(1801ms + i * 1ms));
  EXPECT_TRUE(b.chatters());
  b.begin(false, at(10s));
  EXPECT_FALSE(b.chatters());
}

TEST(Button, ClocksThatGoBackwardsDoNotTurnOrderAround) {
  Button b = button();
  b.edge(true, at(1000ms));
  b.edge(false, at(900ms));
  EXPECT_FALSE(b.tick(at(1019ms)));
  EXPECT_FALSE(b.tick(at(1020ms))) << "pressed and released at once";
  EXPECT_FALSE(b.active());
}

}  // namespace
}  // namespace booth::drivers::gpio

// The simulated board refuses, forgets and floats where a kernel's chip does.
#include "drivers/gpio/simulated_board.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "drivers/clock/manual_clock.hpp"

namespace booth::drivers::gpio {
namespace {

using namespace std::chrono_literals;

struct BoardTest : ::testing::Test {
  Fault fault_of(const std::function<void()>& work) {
    try {
      work();
    } catch (const Error& e) {
      EXPECT_FALSE(std::string(e.what()).empty());
      return e.fault();
    }
    ADD_FAILURE() << "nothing was refused";
    return Fault::io;
  }
  std::vector<Edge> edges(Chip& chip) {
    std::vector<Edge> out;
    chip.wait(0ns, out);
    return out;
  }
  ManualClock clock;
  SimulatedBoard board{clock, "board", {"a", "b"}};
  std::unique_ptr<ChipSource> chips = make_simulated_chips(board);
};

TEST_F(BoardTest, RefusesWhatIsNotThereOrTaken) {
  EXPECT_EQ(fault_of([&] { (void)chips->open("other"); }), Fault::no_chip);
  const auto chip = chips->open("board"), second = chips->open("board");
  EXPECT_EQ(fault_of([&] { chip->request(0, {.line = "c"}); }), Fault::no_line);
  EXPECT_EQ(fault_of([&] { chip->request(0, {.line = "2"}); }), Fault::no_line);
  chip->request(0, {.line = "1"});
  EXPECT_TRUE(board.requested("b")) << "offsets count from 0";
  EXPECT_EQ(fault_of([&] { second->request(0, {.line = "b"}); }), Fault::busy);
  chip->release(0);
  second->request(0, {.line = "b"});
}

TEST_F(BoardTest, FloatsWhereTheBiasPullsAndKnowsActiveLow) {
  const auto chip = chips->open("board");
  const auto level = [&](bool active_low, Bias bias) {
    chip->request(0, {.line = "a", .output = false, .active_low = active_low, .bias = bias});
    return chip->level(0);
  };
  EXPECT_TRUE(level(false, Bias::pull_up));
  EXPECT_FALSE(level(true, Bias::pull_up));
  EXPECT_FALSE(level(false, Bias::pull_down));
  EXPECT_TRUE(level(true, Bias::pull_down));
  EXPECT_FALSE(level(true, Bias::as_is)) << "a resistor of the board's own";
  board.drive("a", true);
  EXPECT_TRUE(level(false, Bias::pull_down));
  EXPECT_FALSE(level(true, Bias::pull_down));
  board.drive("a", std::nullopt);
  EXPECT_TRUE(level(true, Bias::pull_down));
}

TEST_F(BoardTest, EdgesHaveTheTimeOfTheEdgeAndTheMemoryIsShort) {
  const auto chip = chips->open("board");
  chip->request(0, {.line = "a"});
  board.drive("a", true);
  const auto then = clock.now();
  clock.advance(5s);
  auto seen = edges(*chip);
  ASSERT_EQ(seen.size(), 1u);
  EXPECT_EQ(seen[0].at, then);
  EXPECT_TRUE(seen[0].active);
  for (int i = 0; i < 101; ++i) board.drive("a", i % 2 == 1);
  seen = edges(*chip);
  EXPECT_EQ(seen.size(), 16u);
  EXPECT_FALSE(chip->level(0));
}

TEST_F(BoardTest, UnpluggedIsGoneForGoodUntilOpenedAnew) {
  const auto chip = chips->open("board");
  chip->request(0, {.line = "a", .output = true});
  chip->set(0, true);
  EXPECT_TRUE(board.lit("a"));
  board.unplug();
  EXPECT_FALSE(board.lit("a"));
  EXPECT_EQ(fault_of([&] { chip->set(0, false); }), Fault::gone);
  EXPECT_EQ(fault_of([&] { (void)edges(*chip); }), Fault::gone);
  EXPECT_EQ(fault_of([&] { (void)chips->open("board"); }), Fault::no_chip);
  board.plug_in();
  EXPECT_EQ(fault_of([&] { chip->set(0, false); }), Fault::gone);
  const auto again = chips->open("board");
  again->request(0, {.line = "a", .output = true});
  EXPECT_FALSE(board.lit("a")) << "an output begins inactive";
}

}  // namespace
}  // namespace booth::drivers::gpio

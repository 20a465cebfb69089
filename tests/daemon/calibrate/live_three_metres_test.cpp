// The live capture by itself in a booth of 3 m, and where nobody lays the board on the floor.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/daemon/calibrate/capture_person.hpp"

namespace booth::tests {
namespace {

using fit::calibrate::Calibration;

Calibration captured(CapturePerson& person, daemon::LiveCaptureSettings settings) {
  settings.rules.still_seconds = 0;
  daemon::LiveCaptureHooks hooks;
  hooks.news = [&](const daemon::CaptureNews& news) { person.hear(news); };
  return fit::calibrate::calibrate(daemon::capture_live(person, person.clock, settings, hooks).input());
}

TEST(LiveCapture, InABoothOfThreeMetresItEndsWithinFiveMillimetres) {
  CapturePerson person(3, 5, 32);
  const Calibration c = captured(person, {});
  ASSERT_TRUE(c.accepted()) << c.sentence;
  EXPECT_TRUE(c.origin_from_board);
  EXPECT_LE(misplaced(c.cameras, person.booth(), false).position, 0.005);
}

TEST(LiveCapture, WithoutABoardOnTheFloorItEndsWithThePlansOrigin) {
  CapturePerson person(3, 6, 32);
  person.lays_it_down = false;
  daemon::LiveCaptureSettings settings;
  settings.floor_seconds = 3;
  const Calibration c = captured(person, settings);
  ASSERT_TRUE(c.accepted()) << c.sentence;
  EXPECT_FALSE(c.origin_from_board);
}

}  // namespace
}  // namespace booth::tests

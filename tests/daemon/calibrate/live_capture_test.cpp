// The live capture ends when it is asked to, and by itself when nothing happens; guiding a person to the end has no test yet (docs/design/calibration.md).
#include "daemon/calibrate/live_capture.hpp"

#include <gtest/gtest.h>

#include "daemon/drivers_factory.calibration.hpp"

namespace booth::tests {
namespace {

using namespace daemon;

TEST(LiveCapture, StopsWhenAskedAndGivesUpWhenNothingHappens) {
  auto booth = open_simulated_calibration({.views = 1, .seed = 3}, 3);
  LiveCaptureSettings settings;
  int looks = 0;
  LiveCaptureHooks hooks;
  hooks.news = [&](const CaptureNews&) { ++looks; };
  hooks.stop = [&] { return looks >= 1; };
  EXPECT_EQ(capture_live(booth.cameras, *booth.clock, settings, hooks).input().views, 0) << "one look takes no view";
  EXPECT_EQ(looks, 1);
  hooks.stop = [] { return false; };  // the board stays where it is
  settings.give_up_seconds = 0.2;
  EXPECT_THROW(capture_live(booth.cameras, *booth.clock, settings, hooks), std::runtime_error);
}

}  // namespace
}  // namespace booth::tests

// The capture that guides a person, end to end: simulated cameras, a simulated person who moves on when he hears that a view was taken.
#include "daemon/calibrate/live_capture.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "daemon/drivers_factory.calibration.hpp"

namespace booth::tests {
namespace {

using namespace daemon;

TEST(LiveCapture, APersonIsGuidedFromTheFirstViewToTheFloor) {
  auto booth = open_simulated_calibration({.views = 9, .seed = 3}, 3);
  LiveCaptureSettings settings;
  settings.needs = {.pair_views = 1, .pair_spread = 0, .views = 4};  // the short form of the real thing
  settings.rules.still_seconds = 0;
  std::set<CaptureCue> cues;
  std::vector<std::string> next;
  int views = 0, waited = 0;
  LiveCaptureHooks hooks;
  hooks.news = [&](const CaptureNews& news) {
    cues.insert(news.cue);
    std::string seen;
    for (const auto& name : news.seen) seen += " " + name;
    std::printf("%s (%d taken)%s; %s\n", std::string(to_string(news.cue)).c_str(), news.taken, seen.c_str(), news.next.c_str());  // read when it fails
    std::fflush(stdout);
    if (next.empty() || next.back() != news.next) next.push_back(news.next);
    // A board that only one camera sees is a place to leave, too; a look or two may still show where it was.
    waited = news.cue == CaptureCue::hold_still ? 0 : waited + 1;
    if (news.cue == CaptureCue::captured || waited >= 3) booth.move_on(), waited = 0;
  };
  hooks.view = [&](int number, const std::vector<hal::DepthFrame>& frames) {
    EXPECT_EQ(number, views++);
    for (const auto& f : frames) EXPECT_EQ(f.infrared.size(), f.depth.size());
  };
  const ViewCollector collector = capture_live(booth.cameras, *booth.clock, settings, hooks);
  EXPECT_TRUE(cues.contains(CaptureCue::captured));
  EXPECT_TRUE(cues.contains(CaptureCue::hold_still));
  EXPECT_TRUE(cues.contains(CaptureCue::done));
  EXPECT_GE(views, 5);
  EXPECT_EQ(collector.input().views, views);
  EXPECT_THAT(next.front(), testing::HasSubstr("hold the board"));
  EXPECT_THAT(next, testing::Contains(testing::StartsWith("lay the board on the floor")));
  EXPECT_EQ(next.back(), "");
}

TEST(LiveCapture, StopsWhenAskedAndGivesUpWhenNothingHappens) {
  auto booth = open_simulated_calibration({.views = 1, .seed = 3}, 3);
  LiveCaptureSettings settings;
  int looks = 0;
  LiveCaptureHooks hooks;
  hooks.news = [&](const CaptureNews&) { ++looks; };
  hooks.stop = [&] { return looks >= 1; };
  EXPECT_EQ(capture_live(booth.cameras, *booth.clock, settings, hooks).input().views, 0) << "one look takes no view";
  hooks.stop = [] { return false; };  // the board stays where it is
  settings.give_up_seconds = 0.2;
  EXPECT_THROW(capture_live(booth.cameras, *booth.clock, settings, hooks), std::runtime_error);
}

}  // namespace
}  // namespace booth::tests

// The live capture guides a simulated person to an accepted calibration, and ends by itself in every other case.
#include "daemon/calibrate/live_capture.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <future>

#include "daemon/drivers_factory.calibration.hpp"
#include "drivers/clock/manual_clock.hpp"
#include "tests/daemon/calibrate/rendered_booth.hpp"

namespace booth::tests {
namespace {

using namespace daemon;
using namespace std::chrono_literals;
using fit::calibrate::Calibration;
using fit::calibrate::Rigid;

/// Four rendered cameras and a person who does what he is told: moves on after each view, and lays the board down when he is asked to. A look takes a second.
class Person final : public FrameFeed {
 public:
  Person(double side, std::uint64_t seed, int views) : booth_(side, seed, views), views_(views) {}

  std::vector<hal::CameraDescription> cameras() const override { return booth_.planned; }
  std::vector<hal::DepthFrame> take(hal::Nanoseconds) override {
    clock.advance(1s);
    ++looks;
    drivers::ShownBoard shown;
    shown.booth_from_board = booth_.places[static_cast<std::size_t>(lies_ ? views_ : at_ % views_)];
    std::vector<std::future<hal::DepthFrame>> frames;
    for (auto& camera : booth_.camera) frames.push_back(std::async(std::launch::async, [&] { return camera.look(shown, static_cast<std::uint64_t>(looks)); }));
    std::vector<hal::DepthFrame> out;
    for (auto& f : frames) out.push_back(f.get());
    std::erase_if(out, [&](const auto& f) { return hal::to_int(f.camera) == silent_camera; });
    return out;
  }
  std::vector<std::string> silent() const override {
    return silent_camera >= 0 ? std::vector{booth_.planned[static_cast<std::size_t>(silent_camera)].name} : std::vector<std::string>{};
  }

  void hear(const CaptureNews& news) {
    said.push_back(news.next);
    lies_ = lays_it_down && news.next.starts_with("lay the board on the floor");
    waited_ = news.cue == CaptureCue::hold_still ? 0 : waited_ + 1;
    if (news.cue == CaptureCue::captured || waited_ >= 2) ++at_, waited_ = 0;
  }
  const RenderedBooth& booth() const { return booth_; }

  drivers::ManualClock clock;
  bool lays_it_down = true;
  int silent_camera = -1, looks = 0;
  std::vector<std::string> said;

 private:
  RenderedBooth booth_;
  const int views_;
  int at_ = 0, waited_ = 0;
  bool lies_ = false;
};

Calibration captured(Person& person, LiveCaptureSettings settings = {}) {
  LiveCaptureHooks hooks;
  hooks.news = [&](const CaptureNews& news) { person.hear(news); };
  return fit::calibrate::calibrate(capture_live(person, person.clock, settings, hooks).input());
}

struct Worst {
  double position = 0, angle = 0;  // metres, degrees
};

Worst worst(const Calibration& c, const RenderedBooth& booth) {
  Worst out;
  for (std::size_t i = 0; i < c.cameras.size(); ++i) {
    const Rigid real = rigid_of(booth.real[i].camera_to_world);
    out.position = std::max(out.position, (c.cameras[i].booth_from_camera.translation - real.translation).norm());
    out.angle = std::max(out.angle, fit::calibrate::angle_between(c.cameras[i].booth_from_camera.rotation, real.rotation) * 180 / EIGEN_PI);
  }
  return out;
}

/// The origin is the board's on the floor: in the 4 m booth no finder for pictures sees it there.
TEST(LiveCapture, GuidesAPersonToAnAcceptedCalibration) {
  for (const double side : {3.0, 4.0}) {
    Person person(side, 5, 32);
    const Calibration c = captured(person);
    ASSERT_TRUE(c.accepted()) << side << " m: " << c.sentence;
    const Worst w = worst(c, person.booth());
    std::printf("%.0f m: %d looks, %d views; cameras in the booth %.1f mm, %.2f degrees off; held out %.2f px, %.1f mm\n", side, person.looks, c.progress.views,
                1000 * w.position, w.angle, c.errors.reprojection_px, c.errors.corner_mm);
    EXPECT_TRUE(c.origin_from_board) << side;
    EXPECT_LE(w.position, 0.010) << side;
    EXPECT_LE(w.angle, 0.2) << side;
    EXPECT_THAT(person.said, testing::Contains(testing::StartsWith("lay the board on the floor")));
    EXPECT_EQ(person.said.back(), "");
  }
}

TEST(LiveCapture, EndsWithoutABoardOnTheFloorToo) {
  Person person(3, 6, 32);
  person.lays_it_down = false;
  const Calibration c = captured(person, {.floor_seconds = 3});
  ASSERT_TRUE(c.accepted()) << c.sentence;
  EXPECT_FALSE(c.origin_from_board);
}

TEST(LiveCapture, NamesACameraThatDeliversNothingAndGivesUp) {
  Person person(3, 6, 4);
  person.silent_camera = 2;
  LiveCaptureSettings settings;
  settings.give_up_seconds = 4;
  settings.rules.still_seconds = 1e9;
  try {
    captured(person, settings);
    FAIL() << "a capture without views ended well";
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr("no new view of the board for 4 s, and no pictures came from back-right"));
  }
  EXPECT_THAT(person.said, testing::Each(testing::StartsWith("no pictures come from back-right")));
}

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

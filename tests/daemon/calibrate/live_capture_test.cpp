// A booth calibrates itself while it runs: asked by a person, guided to the end by what status says, stored, refused or given up.
#include "daemon/calibrate/live_capture.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/calibrate/booth_calibration.hpp"
#include "daemon/calibrate/calibration_store.hpp"
#include "daemon/calibrate/infrared_tap.hpp"
#include "daemon/ctl/control_protocol.hpp"
#include "daemon/drivers_factory.calibration.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/calibrate/capture_person.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {
namespace {

using namespace daemon;
using namespace std::chrono_literals;
constexpr double kDegree = EIGEN_PI / 180;

LiveCaptureSettings at_first_sight() {
  LiveCaptureSettings out;
  out.rules.still_seconds = 0;
  return out;
}

/// A daemon's session around a person who calibrates.
struct Booth {
  explicit Booth(double side) : person(side, 5, 32) {
    calibration = std::make_unique<BoothCalibration>(
        BoothCalibrationSettings{
            .file = folder.path / "calibration.toml", .cannot = {}, .capture = at_first_sight(), .software = "boothd test", .open = {}, .close = {}},
        person, person.clock);
    person.listen = [this] {
      const CalibrationStatus s = calibration->status();
      return CaptureNews{.cue = s.cue, .taken = s.views, .seen = {}, .next = s.next};
    };
    for (int i = 0; i < 2; ++i) cameras.push_back(std::make_unique<FakeCamera>("c" + std::to_string(i), clock, 0ms, 1'000'000, true));
    ControllerSettings settings;
    settings.session_directory = folder.path;
    settings.calibrator = calibration.get();
    settings.on_event = [this](const std::string&, const std::string& source, const std::string& text) {
      const std::lock_guard lock(mutex);
      if (source == "calibration") events.push_back(text);
    };
    controller = std::make_unique<Controller>(settings, clock);
    pipeline = std::make_unique<Pipeline>(Pipeline::Settings{.minimum_cameras = 2, .synchroniser = {}}, cameras, clock, fitter, *controller);
    controller->run(*pipeline, fitter, nullptr);
  }
  ~Booth() { controller->shutdown("test"); }
  std::string ask(const std::string& request) { return answer_request("{\"request\":\"" + request + "\"}", *controller); }
  bool waits_until_idle() {
    for (int i = 0; i < 12'000 && controller->state() != SessionState::idle; ++i) std::this_thread::sleep_for(50ms);
    return controller->state() == SessionState::idle;
  }

  TemporaryFolder folder;
  drivers::SystemClock clock;
  CapturePerson person;
  hal::DepthCameras cameras;
  FakeFitter fitter;
  std::unique_ptr<BoothCalibration> calibration;
  std::mutex mutex;
  std::vector<std::string> events;
  std::unique_ptr<Controller> controller;
  std::unique_ptr<Pipeline> pipeline;
};

/// Four cameras 4 m apart: no finder for pictures sees the board on the floor there, and yet it gives the origin.
TEST(LiveCapture, ABoothOfFourMetresCalibratesItselfWhileItRuns) {
  Booth booth(4);
  EXPECT_THAT(booth.ask("calibrate"), testing::HasSubstr("\"ok\":true,\"state\":\"calibrating\""));
  EXPECT_THAT(booth.ask("start"), testing::HasSubstr("a calibration is running; stop it first"));
  ASSERT_TRUE(booth.waits_until_idle());
  const CalibrationStatus s = booth.calibration->status();
  ASSERT_EQ(s.outcome, CalibrationStatus::Outcome::stored) << s.sentence;
  EXPECT_TRUE(s.restart);
  EXPECT_THAT(s.sentence, testing::HasSubstr("origin by the board on the floor"));
  EXPECT_THAT(booth.person.said, testing::Contains(testing::StartsWith("lay the board on the floor")));
  EXPECT_THAT(booth.ask("status"), testing::HasSubstr("\"outcome\":\"stored\""));
  const auto stored = load_calibration(booth.folder.path / "calibration.toml");
  EXPECT_EQ(stored.by, "control");
  const Misplaced among = misplaced(stored.calibrated, booth.person.booth(), true), within = misplaced(stored.calibrated, booth.person.booth(), false);
  std::printf("%d looks, %d views; cameras among themselves %.1f mm, %.2f degrees off, in the booth %.1f mm, %.2f degrees\n", booth.person.looks, s.views,
              1000 * among.position, among.angle / kDegree, 1000 * within.position, within.angle / kDegree);
  EXPECT_LE(among.position, 0.006);
  EXPECT_LE(among.angle, 0.15 * kDegree);
  EXPECT_LE(within.position, 0.020);  // a third of a degree of heading, from a board whose squares are six pixels high
  const std::lock_guard lock(booth.mutex);
  EXPECT_GE(booth.events.size(), static_cast<std::size_t>(s.views) / 2) << "progress is told";
}

TEST(LiveCapture, StoppedItChangesNothingAndCanBeginAnew) {
  Booth booth(3);
  EXPECT_THAT(booth.ask("calibrate"), testing::HasSubstr("\"ok\":true"));
  EXPECT_THAT(booth.ask("stop"), testing::HasSubstr("\"ok\":true,\"state\":\"idle\""));
  for (int i = 0; i < 2400 && booth.calibration->status().running; ++i) std::this_thread::sleep_for(50ms);
  EXPECT_EQ(booth.calibration->status().outcome, CalibrationStatus::Outcome::cancelled);
  EXPECT_FALSE(std::filesystem::exists(booth.folder.path / "calibration.toml"));
  EXPECT_THAT(booth.ask("calibrate"), testing::HasSubstr("\"ok\":true"));
  booth.ask("stop");
}

TEST(LiveCapture, WhereItCannotBeStoredItDoesNotBegin) {
  CapturePerson person(3, 1, 4);
  const BoothCalibration nowhere({.file = {}, .cannot = {}, .capture = {}, .software = {}, .open = {}, .close = {}}, person, person.clock);
  EXPECT_THAT(nowhere.why_not(), testing::HasSubstr("set cameras.kinect2.calibration"));
  const BoothCalibration absent({.file = "/nonexistent/c.toml", .cannot = {}, .capture = {}, .software = {}, .open = {}, .close = {}}, person, person.clock);
  EXPECT_THAT(absent.why_not(), testing::StartsWith("/nonexistent cannot be written by boothd"));
}

TEST(LiveCapture, NamesACameraThatDeliversNothingAndGivesUp) {
  CapturePerson person(3, 6, 4);
  person.silent_camera = 2;
  LiveCaptureSettings settings;
  settings.give_up_seconds = 2;
  settings.rules.still_seconds = 1e9;
  LiveCaptureHooks hooks;
  hooks.news = [&](const CaptureNews& news) { person.hear(news); };
  try {
    capture_live(person, person.clock, settings, hooks);
    FAIL() << "a capture without views ended well";
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), testing::HasSubstr("no new view of the board for 2 s, and no pictures came from back-right"));
  }
  EXPECT_THAT(person.said, testing::Each(testing::StartsWith("no pictures come from back-right")));
}

TEST(InfraredTap, GivesPicturesWhileItIsOpenAndHidesThemFromThePipeline) {
  auto booth = open_simulated_calibration({.views = 1, .seed = 3}, 50);
  InfraredTap tap;
  tap.wrap(booth.cameras);
  ASSERT_EQ(tap.cameras().size(), 4u);
  hal::DepthFrame slot;
  const auto read = [&](std::size_t c) {
    while (booth.cameras[c]->read(slot, 1s) != hal::ReadStatus::frame) {
    }
  };
  for (auto& camera : booth.cameras) camera->start();
  read(1);
  EXPECT_TRUE(tap.take(1ms).empty()) << "it is closed";
  tap.open();
  for (const std::size_t c : {0u, 2u}) read(c);
  EXPECT_TRUE(slot.infrared.empty());
  EXPECT_FALSE(slot.depth.empty());
  const auto frames = tap.take(10ms);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(hal::to_int(frames[1].camera), 2);
  EXPECT_EQ(frames[1].infrared.size(), 512u * 424u);
  EXPECT_NE(*std::max_element(frames[1].infrared.begin(), frames[1].infrared.end()), 0);
  tap.close();
  read(0);
  EXPECT_TRUE(slot.infrared.empty());
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

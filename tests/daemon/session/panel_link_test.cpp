// Button and light with a real controller: presses from the wall and requests from elsewhere in one queue, and every trouble shown.
#include "daemon/session/panel_link.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <condition_variable>
#include <deque>
#include <nlohmann/json.hpp>

#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/support/capsule_body.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using hal::LightPattern;
using hal::TriggerKind;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::eventually;
using tests::read_text;

/// A panel without lines: a test presses, and looks at what is shown.
class FakePanel final : public hal::Panel {
 public:
  std::optional<hal::TriggerEvent> wait(hal::Nanoseconds timeout) override {
    std::unique_lock lock(mutex_);
    if (!bell_.wait_for(lock, timeout, [&] { return !events_.empty(); })) return std::nullopt;
    const auto out = events_.front();
    events_.pop_front();
    return out;
  }
  void show(const hal::LightShow& show) override {
    const std::lock_guard lock(mutex_);
    if (shown_.empty() || shown_.back() != show) shown_.push_back(show);
  }
  void play(hal::Sound sound) override {
    const std::lock_guard lock(mutex_);
    played_.push_back(sound);
  }
  std::vector<std::string> problems() const override {
    const std::lock_guard lock(mutex_);
    return problems_;
  }
  std::uint64_t progress() const override { return 0; }

  void press(TriggerKind kind) {
    {
      const std::lock_guard lock(mutex_);
      events_.push_back({kind, {}});
    }
    bell_.notify_one();
  }
  void set_problems(std::vector<std::string> problems) {
    const std::lock_guard lock(mutex_);
    problems_ = std::move(problems);
  }
  hal::LightShow shown() const {
    const std::lock_guard lock(mutex_);
    return shown_.empty() ? hal::LightShow{} : shown_.back();
  }
  std::vector<LightPattern> patterns() const {
    const std::lock_guard lock(mutex_);
    std::vector<LightPattern> out;
    for (const auto& s : shown_)
      if (out.empty() || out.back() != s.pattern) out.push_back(s.pattern);
    return out;
  }
  std::vector<hal::Sound> played() const {
    const std::lock_guard lock(mutex_);
    return played_;
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable bell_;
  std::deque<hal::TriggerEvent> events_;
  std::vector<hal::LightShow> shown_;
  std::vector<hal::Sound> played_;
  std::vector<std::string> problems_;
};

/// A calibration that goes as far as a test lets it.
class FakeCalibrator final : public Calibrator {
 public:
  std::string why_not() const override {
    const std::lock_guard lock(mutex_);
    return cannot;
  }
  void begin(const std::string& by) override {
    const std::lock_guard lock(mutex_);
    status_ = {};
    status_.running = true;
    status_.begun = ++begun_;
    begun_by = by;
  }
  void cancel() override { end(CalibrationStatus::Outcome::cancelled); }
  CalibrationStatus status() const override {
    const std::lock_guard lock(mutex_);
    return status_;
  }

  void sees(CaptureCue cue, int views) {
    const std::lock_guard lock(mutex_);
    status_.cue = cue, status_.views = views, status_.next = "hold the board between a and b";
  }
  void end(CalibrationStatus::Outcome outcome) {
    const std::lock_guard lock(mutex_);
    status_.running = false, status_.outcome = outcome, status_.sentence = "as the test says";
  }

  std::string cannot, begun_by;

 private:
  mutable std::mutex mutex_;
  CalibrationStatus status_;
  std::uint64_t begun_ = 0;
};

struct PanelLinkTest : ::testing::Test {
  void build(hal::Nanoseconds countdown = 0ns, hal::Nanoseconds pause = 60s) {
    for (int i = 0; i < 3; ++i) cameras.push_back(std::make_unique<tests::FakeCamera>("c" + std::to_string(i), clock, i * 8ms, 1'000'000, true));
    ControllerSettings settings;
    settings.session_directory = directory;
    settings.max_age_days = max_age_days;
    settings.limits = {.lost = 200ms, .search = 1s, .session = 60s, .estimate = 60s, .pause = pause, .countdown = countdown, .toggle_guard = 50ms};
    settings.minimum_cameras = 2;
    settings.models.men = tests::capsule_body();
    settings.calibrator = calibrator;
    settings.on_event = [this](const std::string& kind, const std::string& source, const std::string& text) {
      const std::lock_guard lock(events_mutex);
      happened.push_back(kind + " " + source + " " + text);
    };
    controller = std::make_unique<Controller>(settings, clock);
    pipeline = std::make_unique<Pipeline>(Pipeline::Settings{.minimum_cameras = 2, .synchroniser = {}}, cameras, clock, fitter, *controller);
    controller->run(*pipeline, fitter, nullptr);
    link = std::make_unique<PanelLink>(panel, *controller);
    ASSERT_TRUE(shows({LightPattern::idle_steady}));
  }
  void TearDown() override {
    link.reset();
    if (controller) controller->shutdown("test");
    pipeline.reset();
  }
  bool reaches(SessionState s) {
    return eventually([&] { return controller->state() == s; });
  }
  bool shows(const hal::LightShow& show) {
    return eventually([&] { return panel.shown() == show; });
  }
  json session_json() { return json::parse(read_text(std::filesystem::path(controller->status().session_folder) / "session.json")); }

  drivers::SystemClock clock;
  tests::TemporaryFolder folder;
  std::filesystem::path directory = folder.path;
  std::int64_t max_age_days = 0;
  hal::DepthCameras cameras;
  tests::FakeFitter fitter;
  FakePanel panel;
  FakeCalibrator fake;
  Calibrator* calibrator = nullptr;  ///< none, or `fake`
  std::mutex events_mutex;
  std::vector<std::string> happened;
  std::vector<std::string> told() {
    const std::lock_guard lock(events_mutex);
    return happened;
  }
  std::unique_ptr<Controller> controller;
  std::unique_ptr<Pipeline> pipeline;
  std::unique_ptr<PanelLink> link;
};

TEST_F(PanelLinkTest, ASlowDiskIsNoHungThread) {
  // A press begins a session, whose beginning waits for a file: here for one that nobody writes.
  max_age_days = 1;
  std::filesystem::create_directories(directory);
  const auto file = directory / ".clock";
  ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0);
  build();
  panel.press(TriggerKind::start);
  EXPECT_TRUE(eventually([&] { return controller->state() == SessionState::estimating; }));
  std::this_thread::sleep_for(300ms);
  const std::uint64_t of_controller = controller->progress(), of_link = link->progress();
  EXPECT_TRUE(eventually([&] { return controller->progress() != of_controller && link->progress() != of_link; }));
  EXPECT_EQ(controller->status().session_folder, "") << "it waits still";
  EXPECT_TRUE(eventually([&] {
    const int fd = ::open(file.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
    if (fd >= 0) ::close(fd);
    return fd >= 0;
  }));
  EXPECT_TRUE(eventually([&] { return !controller->status().session_folder.empty(); }));
}

TEST_F(PanelLinkTest, AVisitFromPressToPressIsSeenAndWrittenDown) {
  fitter.accept_at = 15;
  build();
  panel.press(TriggerKind::toggle);
  ASSERT_TRUE(shows({LightPattern::estimating_fast_blink}));
  ASSERT_TRUE(shows({LightPattern::tracking_on}));
  fitter.there = false;
  ASSERT_TRUE(shows({LightPattern::searching_slow_blink}));
  fitter.there = true;
  ASSERT_TRUE(shows({LightPattern::tracking_on}));
  panel.press(TriggerKind::toggle);
  ASSERT_TRUE(shows({LightPattern::idle_steady}));
  EXPECT_THAT(panel.played(), ::testing::Contains(hal::Sound::accepted).Times(2));
  EXPECT_THAT(panel.played(), ::testing::Contains(hal::Sound::found).Times(1));

  std::vector<std::string> story;
  std::int64_t before = 0;
  const json j = session_json();
  for (const auto& e : j["events"]) {
    EXPECT_GE(e["utc_ns"].get<std::int64_t>(), before);
    before = e["utc_ns"].get<std::int64_t>();
    story.push_back(e["kind"].get<std::string>() + " " + e["source"].get<std::string>() + " " + e["text"].get<std::string>());
  }
  EXPECT_THAT(story,
              ::testing::IsSupersetOf({"trigger gpio toggle", "state gpio idle -> estimating (toggle)", "state fit estimating -> tracking (body_accepted)",
                                       "state fit tracking -> searching (person_lost)", "state fit searching -> tracking (person_found)"}));
  ASSERT_FALSE(story.empty());
  EXPECT_EQ(story.front(), "trigger gpio toggle");
  EXPECT_THAT(story.back(), HasSubstr("tracking -> finishing (toggle)"));
  link.reset();
  EXPECT_EQ(panel.shown(), hal::LightShow{}) << "dark when boothd is gone";
}

TEST_F(PanelLinkTest, WallAndKeyboardAreOneQueue) {
  build();
  panel.press(TriggerKind::start);
  ASSERT_TRUE(reaches(SessionState::tracking));
  EXPECT_EQ(controller->request(SessionEvent::start, "control").text, "a session is running already");
  EXPECT_TRUE(controller->request(SessionEvent::stop, "control").accepted);
  ASSERT_TRUE(reaches(SessionState::idle));
  panel.press(TriggerKind::stop);
  EXPECT_TRUE(eventually([&] {
    const auto played = panel.played();
    return std::find(played.begin(), played.end(), hal::Sound::refused) != played.end();
  })) << "a stop while idle is refused, and heard to be";
  EXPECT_EQ(session_json()["reason"], "stop");
}

TEST_F(PanelLinkTest, ALongPressBeginsACalibrationThatLightAndSoundGuide) {
  calibrator = &fake;
  build();
  panel.press(TriggerKind::calibrate);
  ASSERT_TRUE(reaches(SessionState::calibrating));
  EXPECT_EQ(fake.begun_by, "gpio");
  ASSERT_TRUE(shows({LightPattern::searching_slow_blink}));
  fake.sees(CaptureCue::hold_still, 0);
  ASSERT_TRUE(shows({LightPattern::estimating_fast_blink}));
  fake.sees(CaptureCue::captured, 1);
  ASSERT_TRUE(shows({LightPattern::tracking_on}));
  EXPECT_TRUE(eventually([&] { return panel.played() == std::vector{hal::Sound::accepted, hal::Sound::accepted}; })) << "the press, and the view";
  EXPECT_EQ(controller->request(SessionEvent::start, "control").text, "a calibration is running; stop it first") << "whoever steps in meanwhile";
  EXPECT_EQ(controller->request(SessionEvent::calibrate, "dds").text, "a calibration is running already");
  fake.end(CalibrationStatus::Outcome::stored);
  ASSERT_TRUE(reaches(SessionState::idle));
  EXPECT_TRUE(eventually([&] {
    const auto played = panel.played();
    return !played.empty() && played.back() == hal::Sound::ended;
  }));
  EXPECT_THAT(told(), ::testing::IsSupersetOf({"trigger gpio calibrate", "state gpio idle -> calibrating (calibrate)",
                                               "state calibration stored: as the test says", "state calibration calibrating -> idle (calibration_over)"}));
  EXPECT_TRUE(controller->request(SessionEvent::start, "control").accepted) << "and then the booth is as it was";
  ASSERT_TRUE(reaches(SessionState::tracking));
}

TEST_F(PanelLinkTest, AShortPressAnEmergencyAndAStopEndACalibration) {
  calibrator = &fake;
  build();
  for (const auto kind : {TriggerKind::toggle, TriggerKind::stop, TriggerKind::emergency_pressed}) {
    ASSERT_TRUE(controller->request(SessionEvent::calibrate, "dds").accepted);
    ASSERT_EQ(controller->state(), SessionState::calibrating);
    panel.press(kind);
    ASSERT_TRUE(reaches(SessionState::idle));
    EXPECT_EQ(fake.status().outcome, CalibrationStatus::Outcome::cancelled);
  }
  ASSERT_TRUE(shows({LightPattern::fault_code, 1, false})) << "or the light of before would be taken for that of the release";
  EXPECT_EQ(controller->request(SessionEvent::calibrate, "dds").text, "the emergency stop is pressed; release it first");
  panel.press(TriggerKind::emergency_released);
  ASSERT_TRUE(shows({LightPattern::idle_steady}));
  fake.cannot = "nobody says where the calibration belongs";
  EXPECT_EQ(controller->request(SessionEvent::calibrate, "dds").text, fake.cannot);
  EXPECT_EQ(controller->state(), SessionState::idle);
}

TEST_F(PanelLinkTest, ALongPressIsAnsweredWhereNothingCanBeCalibrated) {
  build();
  panel.press(TriggerKind::calibrate);
  EXPECT_TRUE(eventually([&] { return panel.played() == std::vector{hal::Sound::refused}; }));
  EXPECT_EQ(controller->request(SessionEvent::calibrate, "test").text, "this booth has no cameras that can be calibrated");
  EXPECT_EQ(controller->state(), SessionState::idle);
  panel.press(TriggerKind::toggle);
  ASSERT_TRUE(reaches(SessionState::tracking));
  EXPECT_THAT(controller->request(SessionEvent::calibrate, "test").text, HasSubstr("end the session first"));
  EXPECT_EQ(controller->state(), SessionState::tracking);
}

TEST_F(PanelLinkTest, AnEmergencyStopEndsAndLatchesAndShows) {
  build();
  panel.press(TriggerKind::toggle);
  ASSERT_TRUE(reaches(SessionState::tracking));
  panel.press(TriggerKind::emergency_pressed);
  ASSERT_TRUE(shows({LightPattern::fault_code, 1, false}));
  ASSERT_TRUE(reaches(SessionState::idle));
  EXPECT_EQ(session_json()["reason"], "emergency_pressed");
  panel.press(TriggerKind::toggle);
  panel.press(TriggerKind::emergency_released);
  ASSERT_TRUE(shows({LightPattern::idle_steady})) << "releasing starts nothing, nor does what was pressed meanwhile";
  EXPECT_EQ(controller->state(), SessionState::idle);
  std::this_thread::sleep_for(60ms);  // the guard of the toggle
  panel.press(TriggerKind::toggle);
  EXPECT_TRUE(reaches(SessionState::tracking));
}

TEST_F(PanelLinkTest, ACountdownIsSeenHeardAndCanBeCancelled) {
  build(1500ms);
  panel.press(TriggerKind::toggle);
  ASSERT_TRUE(shows({LightPattern::countdown_double_blink}));
  EXPECT_GE(controller->status().countdown_seconds, 1);
  std::this_thread::sleep_for(60ms);
  panel.press(TriggerKind::toggle);
  ASSERT_TRUE(shows({LightPattern::idle_steady}));
  EXPECT_EQ(controller->status().session, "") << "nothing was begun";
  std::this_thread::sleep_for(60ms);
  panel.press(TriggerKind::toggle);
  ASSERT_TRUE(reaches(SessionState::tracking));
  EXPECT_THAT(panel.played(), ::testing::Contains(hal::Sound::countdown).Times(::testing::Ge(2)));
  controller->request(SessionEvent::stop, "test");
  ASSERT_TRUE(reaches(SessionState::idle));
  const json events = session_json()["events"];
  EXPECT_EQ(events[0]["text"], "toggle") << "the press before the countdown belongs to the story";
  EXPECT_EQ(events[1]["text"], "idle -> countdown (toggle)");
  EXPECT_EQ(events[2]["text"], "countdown -> estimating (countdown_over)");
}

TEST_F(PanelLinkTest, MissingCamerasFlickerAndTooFewAreAFault) {
  build();
  panel.press(TriggerKind::toggle);
  ASSERT_TRUE(reaches(SessionState::tracking));
  static_cast<tests::FakeCamera&>(*cameras[0]).lost = true;
  ASSERT_TRUE(shows({LightPattern::tracking_on, 0, true}));
  static_cast<tests::FakeCamera&>(*cameras[1]).lost = true;
  ASSERT_TRUE(shows({LightPattern::fault_code, 2, false}));
  for (int i = 0; i < 2; ++i) static_cast<tests::FakeCamera&>(*cameras[static_cast<std::size_t>(i)]).plug_in();
  ASSERT_TRUE(shows({LightPattern::tracking_on}));
}

TEST_F(PanelLinkTest, APauseThatLastsEndsTheSession) {
  build(0ns, 300ms);
  panel.press(TriggerKind::toggle);
  ASSERT_TRUE(reaches(SessionState::tracking));
  for (int i = 0; i < 2; ++i) static_cast<tests::FakeCamera&>(*cameras[static_cast<std::size_t>(i)]).lost = true;
  ASSERT_TRUE(reaches(SessionState::idle));
  EXPECT_EQ(session_json()["reason"], "pause_over");
}

TEST_F(PanelLinkTest, SessionsThatAreNotSavedAreAFaultOnceNobodyIsCaptured) {
  directory = folder.write("in-the-way", "") / "sessions";
  build();
  panel.press(TriggerKind::toggle);
  ASSERT_TRUE(shows({LightPattern::tracking_on, 0, true}));
  panel.press(TriggerKind::stop);
  ASSERT_TRUE(shows({LightPattern::fault_code, 3, false}));
}

TEST_F(PanelLinkTest, AProblemOfThePanelIsAnAlarmAndTheNextThingOnTheLight) {
  build();
  panel.set_problems({"start button: line \"start\" is gone", "light: line \"light\" is gone"});
  ASSERT_TRUE(shows({LightPattern::fault_code, 4, false}));
  ASSERT_TRUE(eventually([&] { return controller->status().panel.problems.size() == 2; }));
  EXPECT_EQ(controller->status().alarm, "start button: line \"start\" is gone");
  panel.set_problems({});
  ASSERT_TRUE(shows({LightPattern::idle_steady}));
  EXPECT_TRUE(eventually([&] { return controller->status().alarm.empty(); }));
}

}  // namespace
}  // namespace booth::daemon

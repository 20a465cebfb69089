// Whole sessions with simulated cameras and a fitter that sees what it is told: states, files, alarms, answers to garbage.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "daemon/ctl/control_protocol.hpp"
#include "daemon/session/controller.hpp"
#include "daemon/session/dds_samples.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/dds/peer.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/support/capsule_body.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::eventually;
using tests::read_text;

struct SessionTest : ::testing::Test {
  void build(std::filesystem::path directory, std::uint64_t frames = 1'000'000) {
    for (int i = 0; i < 3; ++i) cameras.push_back(std::make_unique<tests::FakeCamera>("c" + std::to_string(i), clock, i * 8ms, frames, true));
    ControllerSettings settings;
    settings.session_directory = std::move(directory);
    settings.limits = {.lost = 200ms, .search = 1s, .session = 60s, .toggle_guard = 500ms};
    settings.minimum_cameras = 2;
    settings.models.men = tests::capsule_body();
    settings.calibrated_utc_ns = calibrated_utc_ns;
    settings.calibration_residual = calibration_residual;
    controller = std::make_unique<Controller>(settings, clock);
    pipeline = std::make_unique<Pipeline>(Pipeline::Settings{.minimum_cameras = 2, .synchroniser = {}}, cameras, clock, fitter, *controller);
    controller->run(*pipeline, fitter, dds.get());
  }
  void TearDown() override {
    if (controller) controller->shutdown("test");
    pipeline.reset();
  }
  bool reaches(SessionState s) {
    return eventually([&] { return controller->state() == s; });
  }
  json session_json() { return json::parse(read_text(std::filesystem::path(controller->status().session_folder) / "session.json")); }

  drivers::SystemClock clock;
  std::int64_t calibrated_utc_ns = 0;
  double calibration_residual = -1;
  tests::TemporaryFolder folder;
  hal::DepthCameras cameras;
  tests::FakeFitter fitter;
  std::unique_ptr<DdsLink> dds;  ///< null: the booth is not on DDS
  std::unique_ptr<Controller> controller;
  std::unique_ptr<Pipeline> pipeline;
};

TEST_F(SessionTest, StartTrackStop) {
  build(folder.path);
  EXPECT_EQ(controller->request(SessionEvent::stop, "test").text, "no session is running");
  const ControlAnswer started = controller->request(SessionEvent::start, "test");
  EXPECT_TRUE(started.accepted);
  EXPECT_EQ(started.state, SessionState::estimating);
  ASSERT_TRUE(reaches(SessionState::tracking));
  EXPECT_EQ(controller->request(SessionEvent::start, "test").text, "a session is running already");
  ASSERT_TRUE(eventually([&] { return controller->status().counters.fitted >= 15; }));
  EXPECT_EQ(session_json()["result"], "running");
  EXPECT_TRUE(controller->request(SessionEvent::stop, "test").accepted);
  ASSERT_TRUE(reaches(SessionState::idle));
  const json j = session_json();
  EXPECT_EQ(j["result"], "complete");
  EXPECT_EQ(j["reason"], "stop");
  EXPECT_EQ(j["state_at_end"], "tracking");
  EXPECT_GE(j["frames"].get<int>(), 15);
  EXPECT_GT(j["latency_ms"]["p50"].get<double>(), 0);
  EXPECT_TRUE(j["stage_ms"].contains("wait"));
  EXPECT_TRUE(std::filesystem::exists(std::filesystem::path(controller->status().session_folder) / "skeleton.csv"));
}

TEST_F(SessionTest, StatusTellsOfCalibrationAndDisk) {
  calibrated_utc_ns = clock.utc_now().time_since_epoch().count() - 86'400'000'000'000;
  calibration_residual = 0.0042;
  build(folder.path / "not" / "yet" / "made");
  ASSERT_TRUE(eventually([&] { return controller->status().disk.free >= 0; }));
  const DaemonStatus status = controller->status();
  const json j = json::parse(status_json(status));
  EXPECT_NEAR(j["calibration_age_s"].get<double>(), 86400, 60);
  EXPECT_EQ(j["calibration_residual"], 0.0042);
  EXPECT_GT(j["disk_total_bytes"].get<std::int64_t>(), 0);
  EXPECT_LE(j["disk_free_bytes"].get<std::int64_t>(), j["disk_total_bytes"].get<std::int64_t>());
  const StatusSample sample = status_sample(status);
  EXPECT_EQ(sample.calibration_age_s, status.calibration_age_s);
  EXPECT_EQ(sample.calibration_residual, 0.0042);
  EXPECT_EQ(sample.disk_free_bytes, status.disk.free);
  EXPECT_EQ(sample.disk_total_bytes, status.disk.total);
}

TEST_F(SessionTest, WhatIsNotKnownOfTheCalibrationIsNull) {
  calibrated_utc_ns = clock.utc_now().time_since_epoch().count() + 86'400'000'000'000;  // this clock was never set
  build(folder.path);
  const json j = json::parse(status_json(controller->status()));
  for (const char* key : {"calibration_age_s", "calibration_residual"}) {
    ASSERT_TRUE(j.contains(key)) << key;
    EXPECT_EQ(j[key], json()) << key;
  }
}

TEST_F(SessionTest, OneSideOfABodyIsRemarked) {
  build(folder.path);
  controller->request(SessionEvent::start, "test");
  ASSERT_TRUE(reaches(SessionState::tracking));
  EXPECT_EQ(controller->status().remark, "");
  fitter.coverage = 0.55f;
  ASSERT_TRUE(eventually([&] { return !controller->status().remark.empty(); }));
  EXPECT_EQ(json::parse(status_json(controller->status()))["remark"],
            "coverage: partial. The points show 55 % of the body; the rest is inferred and less certain");
  controller->request(SessionEvent::stop, "test");
  ASSERT_TRUE(reaches(SessionState::idle));
  EXPECT_EQ(controller->status().remark, "") << "of nobody";
}

TEST_F(SessionTest, TwoSessionsAreTwoFolders) {
  build(folder.path);
  std::vector<std::string> seen;
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(controller->request(SessionEvent::start, "test").accepted);
    ASSERT_TRUE(reaches(SessionState::tracking));
    seen.push_back(controller->status().session_folder);
    controller->request(SessionEvent::stop, "test");
    ASSERT_TRUE(reaches(SessionState::idle));
  }
  EXPECT_NE(seen[0], seen[1]);
  EXPECT_EQ(fitter.resets, 2) << "the second person is not the first";
}

TEST_F(SessionTest, LosesFindsAndGivesUp) {
  build(folder.path);
  controller->request(SessionEvent::start, "test");
  ASSERT_TRUE(reaches(SessionState::tracking));
  fitter.there = false;
  ASSERT_TRUE(reaches(SessionState::searching));
  EXPECT_EQ(controller->status().remark, "the stage is empty");
  fitter.there = true;
  ASSERT_TRUE(reaches(SessionState::tracking));
  fitter.there = false;
  ASSERT_TRUE(reaches(SessionState::idle)) << "after search_seconds";
  EXPECT_EQ(session_json()["reason"], "search_over");
  EXPECT_EQ(session_json()["state_at_end"], "searching");
}

/// What booth/body says of the last body that was accepted.
struct BodyEar {
  explicit BodyEar(const char* booth) : peer(booth), reader(peer.reader(booth_msg_Body_desc, "booth/body", true, true)) {}
  /// beta[0] of the next body; nothing when none comes.
  std::optional<double> next(std::chrono::milliseconds limit = 20s) {
    std::optional<double> out;
    tests::take<booth_msg_Body>(
        reader,
        [&](const booth_msg_Body& b) {
          EXPECT_GT(b.utc_ns, last_utc_ns) << "which of them is the newer one";
          out = b.beta._length > 0 ? b.beta._buffer[0] : 0;
          session = b.session;
          last_utc_ns = b.utc_ns;
        },
        limit);
    return out;
  }
  tests::Peer peer;
  dds_entity_t reader;
  std::string session;
  std::int64_t last_utc_ns = 0;
};

TEST_F(SessionTest, EachPersonsBodyIsToldOnceInASession) {
  dds = std::make_unique<DdsLink>(tests::loopback("body-booth"), clock, [](DdsCommand) { return DdsAnswer{}; });
  build(folder.path);
  BodyEar ear("body-booth");
  fitter.shape = 1;
  controller->request(SessionEvent::start, "test");
  EXPECT_EQ(ear.next(), 1.0);
  const std::string session = ear.session;
  const auto known_again_as = [&](double shape) {
    const int steps = fitter.steps;
    fitter.known = false;
    ASSERT_TRUE(eventually([&] { return fitter.steps >= steps + 3; }));
    fitter.shape = shape;
    fitter.known = true;
  };
  // The same person, found again: nobody has anything to learn of it.
  known_again_as(1.05);
  EXPECT_EQ(ear.next(1500ms), std::nullopt);
  // Out of sight is not unknown.
  fitter.there = false;
  ASSERT_TRUE(reaches(SessionState::searching));
  fitter.there = true;
  EXPECT_EQ(ear.next(1500ms), std::nullopt);
  // Somebody else.
  known_again_as(-2);
  EXPECT_EQ(ear.next(), -2.0);
  EXPECT_EQ(ear.session, session) << "of the same session";
  // A fit that cannot decide: the last word counts, and it comes, but not each of them.
  for (int k = 1; k <= 5; ++k) known_again_as(k);
  std::vector<double> told;
  for (auto body = ear.next(); body; body = told.back() == 5 ? std::nullopt : ear.next()) told.push_back(*body);
  ASSERT_FALSE(told.empty());
  EXPECT_EQ(told.back(), 5.0);
  EXPECT_LE(told.size(), 4u);
  controller->request(SessionEvent::stop, "test");
  ASSERT_TRUE(reaches(SessionState::idle));
  const json j = session_json();
  EXPECT_EQ(j["beta"][0], 5.0) << "the last body is the session's";
  EXPECT_EQ(std::count_if(j["events"].begin(), j["events"].end(),
                          [](const json& e) { return e["text"].get<std::string>().starts_with("another person's body is accepted"); }),
            static_cast<std::ptrdiff_t>(1 + told.size()));
}

TEST_F(SessionTest, ABodyAcceptedJustBeforeTheEndIsTold) {
  dds = std::make_unique<DdsLink>(tests::loopback("late-body-booth"), clock, [](DdsCommand) { return DdsAnswer{}; });
  build(folder.path);
  BodyEar ear("late-body-booth");
  fitter.shape = 1;
  controller->request(SessionEvent::start, "test");
  EXPECT_EQ(ear.next(), 1.0);
  for (const double shape : {2.0, 3.0}) {
    const int steps = fitter.steps;
    fitter.known = false;
    ASSERT_TRUE(eventually([&] { return fitter.steps >= steps + 3; }));
    fitter.shape = shape;
    fitter.known = true;
    ASSERT_TRUE(eventually([&] { return fitter.steps >= steps + 6; }));
  }
  controller->request(SessionEvent::stop, "test");
  ASSERT_TRUE(reaches(SessionState::idle));
  double last = 0;
  while (last != 3) {
    const auto body = ear.next(3s);
    ASSERT_TRUE(body) << "told last was " << last;
    last = *body;
  }
}

TEST_F(SessionTest, EmergencySavesAndLatches) {
  build(folder.path);
  controller->request(SessionEvent::start, "test");
  ASSERT_TRUE(reaches(SessionState::tracking));
  controller->request(SessionEvent::emergency_pressed, "button");
  ASSERT_TRUE(reaches(SessionState::idle));
  EXPECT_EQ(session_json()["reason"], "emergency_pressed");
  EXPECT_THAT(controller->request(SessionEvent::start, "test").text, HasSubstr("emergency"));
  ASSERT_TRUE(eventually([&] { return controller->status().latched; }));
  controller->request(SessionEvent::emergency_released, "button");
  EXPECT_TRUE(controller->request(SessionEvent::start, "test").accepted);
}

TEST_F(SessionTest, NothingBeginsWhileItEnds) {
  build(folder.path);
  ASSERT_TRUE(controller->request(SessionEvent::start, "test").accepted);
  ASSERT_TRUE(reaches(SessionState::tracking));
  std::atomic<bool> told{false};
  // A client on the network that asks again and again, as one that lost its answer does.
  std::thread client([&] {
    while (!told) told = controller->request(SessionEvent::start, "dds").text == "boothd is ending";
  });
  controller->shutdown("signal");
  client.join();
  EXPECT_EQ(controller->state(), SessionState::idle);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path), {}), 1);
}

TEST_F(SessionTest, FramesThatCannotBeWrittenAreAnAlarmAtOnce) {
  build(folder.path);
  ASSERT_TRUE(controller->request(SessionEvent::start, "test").accepted);
  ASSERT_TRUE(reaches(SessionState::tracking));
  EXPECT_TRUE(controller->status().session_alarm.empty());
  // Files must not grow any more, which needs no full disk.
  ::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit none{1000, before.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &none);
  const bool alarmed = eventually([&] { return !controller->status().session_alarm.empty(); });
  ::setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_TRUE(alarmed);
  EXPECT_THAT(controller->status().session_alarm, HasSubstr("frames cannot be written"));
  EXPECT_EQ(controller->state(), SessionState::tracking) << "it goes on live";
  controller->request(SessionEvent::stop, "test");
  ASSERT_TRUE(reaches(SessionState::idle));
  EXPECT_EQ(session_json()["result"], "interrupted");
  EXPECT_GT(session_json()["frames_not_logged"].get<int>(), 0);
}

TEST_F(SessionTest, ASessionThatCouldNotBeSavedIsSavedAfterTheNext) {
  build(folder.path);
  std::vector<std::filesystem::path> sessions;
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(controller->request(SessionEvent::start, "test").accepted);
    ASSERT_TRUE(reaches(SessionState::tracking));
    sessions.emplace_back(controller->status().session_folder);
    // What cannot be replaced by a file fails as a disk does that is full at the very end.
    if (i == 0) std::filesystem::create_directories(sessions[0] / "skeleton.csv" / "in the way");
    if (i == 1) std::filesystem::remove_all(sessions[0] / "skeleton.csv");
    controller->request(SessionEvent::stop, "test");
    ASSERT_TRUE(reaches(SessionState::idle));
    EXPECT_EQ(controller->status().session_alarm.empty(), i == 1) << controller->status().session_alarm;
    EXPECT_EQ(json::parse(read_text(sessions[0] / "session.json"))["result"], i == 0 ? "running" : "complete");
  }
  EXPECT_EQ(session_json()["result"], "complete");
  EXPECT_EQ(json::parse(controller->status().last_summary->json)["id"], sessions[1].filename().string());
  EXPECT_FALSE(std::filesystem::exists(sessions[0] / ".frames.part"));
}

TEST_F(SessionTest, ACameraThatMovedIsAnAlarmAndNoReasonToStop) {
  using Verdict = CameraDriftStatus::Verdict;
  build(folder.path);
  controller->request(SessionEvent::start, "test");
  ASSERT_TRUE(reaches(SessionState::tracking));
  fitter.says_of_cameras({{.verdict = Verdict::stands}, {.verdict = Verdict::moved, .displacement = 0.021, .deviation = 0.001}, {.verdict = Verdict::unknown}});
  ASSERT_TRUE(eventually([&] { return !controller->status().alarm.empty(); }));
  const DaemonStatus status = controller->status();
  EXPECT_EQ(status.alarm, "camera c1 has moved: its points of a person are 21 mm off; fasten it and calibrate again");
  EXPECT_EQ(status.alarm, status.drift_problem);
  EXPECT_TRUE(status.session_alarm.empty()) << "the session is saved";
  EXPECT_EQ(status.state, SessionState::tracking);
  EXPECT_FALSE(status.degraded) << "no camera is missing";

  const json j = json::parse(status_json(status));
  EXPECT_EQ(j["cameras"][0]["drift"], (json{{"verdict", "stands"}}));
  EXPECT_EQ(j["cameras"][1]["drift"]["verdict"], "moved");
  EXPECT_DOUBLE_EQ(j["cameras"][1]["drift"]["displacement_mm"].get<double>(), 21);
  const StatusSample sample = status_sample(status);
  ASSERT_EQ(sample.faults.size(), 1u);
  EXPECT_EQ(sample.faults[0].first, "cameras");
  EXPECT_THAT(sample.faults[0].second, HasSubstr("c1 has moved"));

  fitter.says_of_cameras({{.verdict = Verdict::stands}, {.verdict = Verdict::stands}, {.verdict = Verdict::blind}});
  ASSERT_TRUE(eventually([&] { return controller->status().alarm.find("c2 sees nothing") != std::string::npos; }));
  fitter.says_of_cameras({{.verdict = Verdict::stands}, {.verdict = Verdict::stands}, {.verdict = Verdict::stands}});
  ASSERT_TRUE(eventually([&] { return controller->status().alarm.empty(); }));
  controller->request(SessionEvent::stop, "test");
  ASSERT_TRUE(reaches(SessionState::idle));
  std::string events;
  const json session = session_json();
  for (const auto& e : session["events"]) events += e["text"].get<std::string>() + "\n";
  EXPECT_THAT(events, HasSubstr("camera c1 has moved"));
  EXPECT_THAT(events, HasSubstr("camera c1 stands where the calibration says"));
}

TEST_F(SessionTest, AnUnwritableFolderMeansLiveOnly) {
  build(folder.write("in-the-way", "") / "sessions");
  EXPECT_TRUE(controller->request(SessionEvent::start, "test").accepted);
  ASSERT_TRUE(reaches(SessionState::tracking));
  EXPECT_THAT(controller->status().alarm, HasSubstr("this session is live only: "));
  EXPECT_THAT(controller->status().alarm, HasSubstr("session.directory"));
  controller->request(SessionEvent::stop, "test");
  EXPECT_TRUE(reaches(SessionState::idle));
}

/// A file system in memory, gone after the test.
struct MountedDisk {
  explicit MountedDisk(std::filesystem::path p) : path(std::move(p)) {
    std::filesystem::create_directory(path);
    mounted = ::mount("booth-test", path.c_str(), "tmpfs", 0, "size=64m") == 0;
  }
  ~MountedDisk() {
    if (mounted) ::umount2(path.c_str(), MNT_DETACH);
  }
  MountedDisk(const MountedDisk&) = delete;
  bool remount(bool read_only) const { return ::mount("booth-test", path.c_str(), "tmpfs", MS_REMOUNT | (read_only ? MS_RDONLY : 0), "size=64m") == 0; }
  std::filesystem::path path;
  bool mounted = false;
};

TEST_F(SessionTest, AReadOnlyDiskMeansLiveOnlyUntilItCanBeWrittenAgain) {
  const MountedDisk disk(folder.path / "disk");
  if (!disk.mounted) GTEST_SKIP() << "skipped: no file system can be mounted here (root is needed)";
  build(disk.path / "sessions");
  const auto session = [&] {
    EXPECT_TRUE(controller->request(SessionEvent::start, "test").accepted);
    EXPECT_TRUE(reaches(SessionState::tracking));
    const std::string alarm = controller->status().alarm;
    controller->request(SessionEvent::stop, "test");
    EXPECT_TRUE(reaches(SessionState::idle));
    return alarm;
  };
  EXPECT_EQ(session(), "");
  const std::filesystem::path saved = controller->status().session_folder;
  ASSERT_TRUE(disk.remount(true));
  const std::string alarm = session();
  EXPECT_THAT(alarm, HasSubstr("this session is live only: "));
  EXPECT_THAT(alarm, HasSubstr("Read-only file system"));
  EXPECT_EQ(controller->status().alarm, alarm) << "until a session is saved again";
  ASSERT_TRUE(disk.remount(false));
  EXPECT_EQ(session(), "");
  EXPECT_EQ(session_json()["result"], "complete");
  EXPECT_EQ(json::parse(read_text(saved / "session.json"))["result"], "complete") << "the one before is untouched";
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(disk.path / "sessions"), {}), 2);
  controller->shutdown("test");
}

TEST_F(SessionTest, ARecordingThatEndsEndsTheSession) {
  build(folder.path, 40);
  controller->request(SessionEvent::start, "test");
  ASSERT_TRUE(reaches(SessionState::tracking));
  ASSERT_TRUE(reaches(SessionState::idle));
  EXPECT_EQ(session_json()["reason"], "sources_ended");
}

TEST_F(SessionTest, TooFewCamerasPauseAndTheSessionGoesOnAfterwards) {
  build(folder.path);
  controller->request(SessionEvent::start, "test");
  ASSERT_TRUE(reaches(SessionState::tracking));
  EXPECT_FALSE(controller->status().degraded);
  static_cast<tests::FakeCamera&>(*cameras[0]).lost = true;
  ASSERT_TRUE(eventually([&] { return controller->status().degraded; }));
  EXPECT_FALSE(controller->status().paused);
  static_cast<tests::FakeCamera&>(*cameras[1]).lost = true;
  ASSERT_TRUE(eventually([&] { return controller->status().paused; }));
  static_cast<tests::FakeCamera&>(*cameras[0]).plug_in();
  static_cast<tests::FakeCamera&>(*cameras[1]).plug_in();
  ASSERT_TRUE(eventually([&] { return !controller->status().degraded; }));
  ASSERT_TRUE(reaches(SessionState::tracking)) << "the person was there all the time";
}

TEST_F(SessionTest, ShutdownInTheMiddleSaves) {
  build(folder.path);
  controller->request(SessionEvent::start, "test");
  ASSERT_TRUE(reaches(SessionState::tracking));
  controller->shutdown("signal");
  EXPECT_EQ(session_json()["result"], "complete");
  EXPECT_THAT(controller->request(SessionEvent::start, "test").text, HasSubstr("boothd is ending"));
}

}  // namespace
}  // namespace booth::daemon

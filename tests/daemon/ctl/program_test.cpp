// boothd and boothctl as programs: exit statuses, a whole session on the simulated booth, SIGTERM in the middle of one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "daemon/ctl/control_client.hpp"
#include "daemon/ctl/control_server.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/program.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::eventually;
using tests::Program;
using tests::read_text;

struct ProgramTest : ::testing::Test {
  int run(const std::string& name, const std::vector<std::string>& arguments) {
    Program program(name, arguments, folder.path / "output");
    const int status = program.wait();
    output = program.output();
    return status;
  }
  std::vector<std::string> daemon_arguments() const {
    std::vector<std::string> out;
    for (const std::string& s : {"control.socket=" + socket, "session.directory=" + sessions.string(), std::string("dds.interface=lo"),
                                 std::string("dds.multicast=false"), std::string("dds.domain=78"), std::string("cameras.synthetic.motion=a-pose")}) {
      out.push_back("--set");
      out.push_back(s);
    }
    return out;
  }
  json ask(const std::string& what) {
    ControlClient client(socket);
    return json::parse(client.ask(json{{"request", what}}.dump()));
  }
  bool is_ready() {
    return eventually(
        [&] {
          try {
            return ask("status")["state"] == "idle";
          } catch (const std::exception&) {
            return false;
          }
        },
        60s);
  }

  tests::TemporaryFolder folder;
  std::string socket = (folder.path / "c.sock").string(), output;
  std::filesystem::path sessions = folder.path / "sessions";
};

TEST_F(ProgramTest, WhatIsMissingIsWaitedForWhereSomebodyStartsItAgain) {
  // Twenty quick ends within five minutes would fail the unit for good, although the sensor, the clock or the disk may still come.
  ::setenv("NOTIFY_SOCKET", (folder.path / "nobody").c_str(), 1);
  Program boothd("boothd", {"--set", "cameras.driver=recording", "--set", "cameras.recording.path=/nonexistent", "--set", "control.socket=" + socket},
                 folder.path / "waits");
  ::unsetenv("NOTIFY_SOCKET");
  ASSERT_TRUE(eventually([&] { return boothd.err().find("tries again in") != std::string::npos; }, 60s)) << boothd.err();
  EXPECT_THAT(boothd.err(), HasSubstr("/nonexistent"));
  boothd.signal(SIGTERM);
  EXPECT_EQ(boothd.wait(), 0) << "told to stop, it has not failed";
}

TEST_F(ProgramTest, ExitStatuses) {
  EXPECT_EQ(run("boothd", {"--version"}), 0);
  EXPECT_THAT(output, HasSubstr("boothd "));
  EXPECT_EQ(run("boothd", {"--help"}), 0);
  EXPECT_EQ(run("boothd", {"--nonsense"}), 64);
  EXPECT_EQ(run("boothd", {"--config", folder.write("b.toml", "[stage]\nradius = \"wide\"\n").string()}), 78);
  EXPECT_THAT(output, HasSubstr("b.toml:2: stage.radius: has the wrong type"));
#if !defined(BOOTHD_HAS_CUDA)
  EXPECT_EQ(run("boothd", {"--set", "fit.backend=cuda"}), 78);
#endif
  EXPECT_THAT(output, HasSubstr("not in this build"));
  EXPECT_EQ(run("boothd", {"--set", "cameras.driver=recording", "--set", "cameras.recording.path=/nonexistent"}), 69);
  EXPECT_EQ(run("boothd", {"--set", "cameras.driver=kinect2"}), 69);
  EXPECT_THAT(output, HasSubstr("cameras.kinect2.serials"));
  EXPECT_EQ(run("boothd", {"--set", "models.directory=/nonexistent"}), 69) << "the simulated booth needs the models, too";
  EXPECT_EQ(run("boothctl", {"status", "--socket", socket}), 1);
  EXPECT_THAT(output, HasSubstr("boothd is not running"));
  EXPECT_EQ(run("boothctl", {"doctor", "--root", folder.path.string(), "--set", "cameras.driver=kinect2", "--json"}), 1);
  EXPECT_THAT(output, HasSubstr("this machine has no USB"));
  EXPECT_EQ(run("boothd", {"--set", "gpio.start=3"}), 78);
  EXPECT_THAT(output, HasSubstr("gpio.chip is not"));
  EXPECT_EQ(run("boothd", {"--check-config", "--set", "gpio.chip=gpiochip9", "--set", "gpio.start=3", "--set", "gpio.light=3"}), 78);
  EXPECT_THAT(output, HasSubstr("gpio.start and gpio.light are the same line \"3\""));
  EXPECT_EQ(run("boothctl", {"dance"}), 64);
  EXPECT_EQ(run("boothctl", {"track", "/nonexistent"}), 1);
}

TEST_F(ProgramTest, AMisspeltVerbIsNamedWithWhatWasMeant) {
  EXPECT_EQ(run("boothctl", {"stats", "--json"}), 64);
  EXPECT_THAT(output, HasSubstr("boothctl: there is no verb stats; did you mean status?"));
  EXPECT_EQ(run("boothctl", {"bench", "feild"}), 64);
  EXPECT_THAT(output, HasSubstr("boothctl bench: there is no verb feild; did you mean field?"));
  EXPECT_EQ(run("boothctl", {"bench", "nonsense"}), 64);
  EXPECT_THAT(output, AllOf(HasSubstr("there is no verb nonsense\n"), Not(HasSubstr("did you mean"))));
  EXPECT_EQ(run("boothctl", {"--bogus"}), 64);
  EXPECT_THAT(output, HasSubstr("boothctl has no option --bogus"));
  EXPECT_EQ(run("boothctl", {}), 64);
  EXPECT_THAT(output, HasSubstr("A subcommand is required"));
}

TEST_F(ProgramTest, TheSignatureIsReportedAsEveryBenchmark) {
  ASSERT_EQ(run("boothctl", {"bench", "signature", "--frames", "1", "--json"}), 0) << output;
  const json j = json::parse(output);
  EXPECT_EQ(j["benchmark"], "signature");
  EXPECT_GE(j["machine"]["cores"].get<int>(), 1);
  EXPECT_NE(j["machine"]["processor"], "");
  ASSERT_EQ(j["results"].size(), 1u);
  EXPECT_EQ(j["results"][0]["name"], "golden frames");
  EXPECT_EQ(j["results"][0]["value"], 1) << "a number, as of every benchmark";
  EXPECT_EQ(j["results"][0]["signature"], j["signature"]);
  EXPECT_EQ(j["frames"], 1);
}

TEST_F(ProgramTest, ASeedIsTheSameEverywhere) {
  // -1 was taken for the greatest number without a sign, and what is above 2^53 no reader of JSON holds.
  const std::string here = folder.path.string(), cloud = folder.write("cloud.xyz", "0 0 0\n").string(), made = (folder.path / "made").string();
  std::filesystem::create_directories(folder.path / "makehuman-cc0");
  std::filesystem::create_directories(folder.path / "ansur2");
  for (const std::vector<std::string>& verb : std::vector<std::vector<std::string>>{{"fit", cloud},
                                                                                    {"track", here},
                                                                                    {"simulate", "--out", made},
                                                                                    {"calibrate", "--simulate", made},
                                                                                    {"model", "train-shape", here, "--out", here},
                                                                                    {"model", "train-pose", here, "--out", made}})
    for (const char* seed : {"-1", "9000000000000001", "99999999999999999999", "1.5"}) {
      auto words = verb;
      words.insert(words.end(), {"--seed", seed});
      EXPECT_EQ(run("boothctl", words), 64) << verb.front() << " " << seed;
      EXPECT_THAT(output, HasSubstr(std::string("--seed: Value ") + seed + " not in range 0 to 9000000000000000")) << verb.front();
    }
  EXPECT_EQ(run("boothctl", {"track", here, "--seed", "9000000000000000"}), 1) << "there is no recording, but the seed is one";
}

TEST_F(ProgramTest, OneFolderOfSessionsHasOneBoothd) {
  Program first("boothd", daemon_arguments(), folder.path / "first");
  ASSERT_TRUE(is_ready()) << first.err();
  ASSERT_TRUE(ask("start")["ok"].get<bool>());
  ASSERT_TRUE(eventually([&] { return ask("status")["frames"] > 5; }, 60s));
  auto second = daemon_arguments();
  second.insert(second.end(), {"--set", "control.socket=" + (folder.path / "other.sock").string()});
  EXPECT_EQ(run("boothd", second), 69) << "it would close the first one's session";
  EXPECT_THAT(output, HasSubstr("another boothd writes its sessions there"));
  EXPECT_EQ(run("boothctl", {"stop", "--wait", "--socket", socket}), 0) << output;
  // What was not saved is no success.
  ASSERT_TRUE(ask("start")["ok"].get<bool>());
  ASSERT_TRUE(eventually([&] { return ask("status")["frames"] > 5; }, 60s));
  std::filesystem::remove_all(sessions);
  EXPECT_EQ(run("boothctl", {"stop", "--wait", "--socket", socket}), 1) << output;
  EXPECT_THAT(output, HasSubstr("is not saved"));
  first.signal(SIGTERM);
  EXPECT_EQ(first.wait(), 0);
}

TEST_F(ProgramTest, DoctorKnowsWhatBoothdCannotStartWithout) {
  EXPECT_EQ(run("boothctl", {"doctor", "--set", "models.directory=/nonexistent"}), 1);
  EXPECT_THAT(output, HasSubstr("no body models"));
  EXPECT_EQ(run("boothctl", {"doctor", "--set", "privacy.seal_to=/nonexistent/key.public"}), 1);
  EXPECT_THAT(output, HasSubstr("/nonexistent/key.public"));
}

TEST_F(ProgramTest, WatchingEndsWhenNobodyReadsIt) {
  const ControlServer boothd(socket, [](const std::string&) { return std::string(R"({"ok":true,"state":"idle"})"); });
  Program shell("/bin/sh", {"-c", "\"$0\" status --watch --json --socket \"$1\" | head -n 1", BOOTH_BINARY_DIR "/bin/boothctl", socket}, folder.path / "shell");
  EXPECT_EQ(shell.wait(), 0) << shell.output();
  EXPECT_THAT(shell.out(), HasSubstr("idle"));
}

TEST_F(ProgramTest, ATruncatedRecordingIsOneSentence) {
  folder.write("rec/metadata.yaml", "rosbag2_bagfile_information:\n  version: 5\n  stor");
  folder.write("rec/rec_0.db3", std::string("SQLite format 3\0garbage", 23));
  EXPECT_EQ(run("boothd", {"--set", "cameras.driver=recording", "--set", "cameras.recording.path=" + (folder.path / "rec").string()}), 69);
  EXPECT_EQ(std::count(output.begin(), output.end(), '\n'), 1) << output;
  EXPECT_EQ(run("boothctl", {"track", (folder.path / "rec").string(), "--out", (folder.path / "out").string()}), 1);
  EXPECT_EQ(std::count(output.begin(), output.end(), '\n'), 1) << output;
}

TEST_F(ProgramTest, OneCamerasRecordingIsTrackedWithAWarningAndItsCalibrationIsSaid) {
  const std::filesystem::path recording = folder.path / "recording", calibration = recording / "calibration.toml";
  EXPECT_EQ(run("boothctl", {"simulate", "--out", recording.string(), "--layout", "folder", "--motion", "a-pose", "--seconds", "1"}), 0) << output;
  EXPECT_EQ(run("boothctl", {"track", recording.string(), "--out", (folder.path / "four").string()}), 0) << output;
  EXPECT_EQ(output.find("warning:"), std::string::npos) << output;
  json j = json::parse(read_text(folder.path / "four/session.json"));
  EXPECT_EQ(j["coverage"], "full") << j["coverage_fraction"];
  EXPECT_EQ(j["calibration"]["file"], calibration.string());
  EXPECT_EQ(j["calibration"]["utc"], json()) << "the time of a copy says nothing";

  // Its first camera alone, with what a stored calibration says of itself.
  std::string text = read_text(calibration);
  text.resize(text.find("[[camera]]", text.find("[[camera]]") + 1));
  std::filesystem::remove(calibration);
  folder.write("recording/calibration.toml",
               text.insert(text.find("[[camera]]"), "[calibration]\nutc = \"2026-11-01T00:00:00Z\"\n[calibration.held_out]\ncorner_mm = 4.5\n\n"));
  EXPECT_EQ(run("boothctl", {"track", recording.string(), "--out", (folder.path / "one").string()}), 0) << output;
  EXPECT_THAT(output, HasSubstr("warning: coverage: partial. The points show "));
  j = json::parse(read_text(folder.path / "one/session.json"));
  EXPECT_EQ(j["coverage"], "partial") << j["coverage_fraction"];
  EXPECT_EQ(j["calibration"]["utc"], "2026-11-01T00:00:00Z");
  EXPECT_EQ(j["calibration"]["held_out"]["corner"], 0.0045);

  auto arguments = daemon_arguments();
  for (const std::string& s : {std::string("cameras.driver=recording"), "cameras.recording.path=" + recording.string(), std::string("cameras.minimum=1")})
    arguments.insert(arguments.end(), {"--set", s});
  Program boothd("boothd", arguments, folder.path / "boothd.log");
  ASSERT_TRUE(is_ready()) << boothd.output();
  const json status = ask("status");
  EXPECT_EQ(status["calibration_residual"], 0.0045);
  EXPECT_GT(status["calibration_age_s"].get<double>(), 0);
  EXPECT_EQ(run("boothctl", {"status", "--socket", socket}), 0);
  EXPECT_THAT(output, HasSubstr("ago, residual 4.5 mm\n"));
  boothd.signal(SIGTERM);
  EXPECT_EQ(boothd.wait(), 0);
}

TEST_F(ProgramTest, CheckConfigPrintsThePlan) {
  EXPECT_EQ(run("boothd", {"--check-config", "--set", "booth.id=lobby"}), 0) << output;
  EXPECT_THAT(output, HasSubstr("id = \"lobby\""));
  EXPECT_THAT(output, HasSubstr("depth frame slots"));
  EXPECT_THAT(output, HasSubstr("estimator"));
  EXPECT_THAT(output, HasSubstr("total"));
}

TEST_F(ProgramTest, CheckConfigGoesOnToTheLastMistake) {
  const std::string file = folder
                               .write("b.toml",
                                      "[stage]\nradius = 50\n"                                        // a key by itself
                                      "[cameras]\nminimum = 8\n"                                      // two together
                                      "[gpio]\nstart = \"3\"\nstop = \"3\"\n"                         // the panel
                                      "[dds]\nsecurity = \"on\"\ncredentials = \"/nonexistent/c\"\n"  // credentials
                                      "[privacy]\nseal_to = \"/nonexistent/k\"\n"                     // the key to seal to
                                      "[models]\ndirectory = \"/nonexistent/m\"\n")                   // cameras and models
                               .string();
  EXPECT_EQ(run("boothd", {"--check-config", "--config", file, "--set", "booth.id=lobby"}), 78);
  std::size_t at = output.find("id = \"lobby\"");
  ASSERT_NE(at, std::string::npos) << output;
  for (const char* wanted : {":2: stage.radius: 50 is out of range", ":4: cameras.minimum: is 8", ":6: gpio.start is set and gpio.chip is not",
                             ":7: gpio.stop is set and gpio.chip is not", ":6: gpio.start and gpio.stop are the same line",
                             ":10: dds.credentials: ", ":12: privacy.seal_to: ", ":14: models.directory: no body models"}) {
    const std::size_t next = output.find(file + wanted);
    ASSERT_NE(next, std::string::npos) << wanted << "\n" << output;
    EXPECT_GT(next, at) << wanted << " comes after what could be resolved";
    at = next;
    EXPECT_EQ(output.find(wanted, next + file.size() + 1), std::string::npos) << wanted << " once";
  }
  EXPECT_THAT(output, HasSubstr("radius = 2\n")) << "the default in its place";
  // A start says the first of them as before, with its place.
  EXPECT_EQ(run("boothd", {"--config", folder.write("k.toml", "[privacy]\nseal_to = \"/nonexistent/k\"\n").string(), "--set", "control.socket=" + socket}), 78);
  EXPECT_THAT(output, HasSubstr("k.toml:2: privacy.seal_to: "));
  EXPECT_EQ(std::count(output.begin(), output.end(), '\n'), 1) << output;
}

TEST_F(ProgramTest, CheckConfigPrintsWhatIsKnownBesideAMistake) {
  EXPECT_EQ(run("boothd", {"--check-config", "--config", folder.write("b.toml", "[fit]\ntreads = 2\n").string(), "--set", "booth.id=lobby"}), 78);
  EXPECT_THAT(output, AllOf(HasSubstr("id = \"lobby\""), HasSubstr("depth frame slots"), HasSubstr("total"), HasSubstr("did you mean fit.threads?")));
  EXPECT_EQ(run("boothd", {"--check-config", "--config", "/nonexistent/b.toml"}), 78);
  EXPECT_THAT(output, AllOf(HasSubstr("id = \"booth\""), HasSubstr("/nonexistent/b.toml: cannot be read: ")));
  // Missing is not wrong: the recording may be on a disk that comes later. The models are looked at all the same.
  const std::vector<std::string> absent{"--check-config", "--set", "cameras.driver=recording", "--set", "cameras.recording.path=/nonexistent/r"};
  EXPECT_EQ(run("boothd", absent), 69);
  EXPECT_THAT(output, AllOf(HasSubstr("/nonexistent/r"), HasSubstr("is not known without")));
  auto both = absent;
  both.insert(both.end(), {"--set", "models.directory=/nonexistent/m"});
  EXPECT_EQ(run("boothd", both), 78);
  EXPECT_THAT(output, AllOf(HasSubstr("/nonexistent/r"), HasSubstr("no body models")));
}

TEST_F(ProgramTest, CheckConfigWarnsOfAChipThatIsNotThere) {
  const std::string file = folder.write("b.toml", "[log]\nlevel = \"error\"\n[gpio]\nstart = \"3\"\nchip = \"gpiochip99\"\n").string();
  EXPECT_EQ(run("boothd", {"--check-config", "--config", file}), 0) << "it may be plugged in later";
  EXPECT_THAT(output, HasSubstr(file + ":5: gpio.chip \"gpiochip99\" is not there: "));
  EXPECT_EQ(run("boothd", {"--check-config", "--set", "gpio.chip=simulated"}), 0);
  EXPECT_THAT(output, Not(HasSubstr("is not there")));
}

TEST_F(ProgramTest, SigtermInTheMiddleOfASessionSavesIt) {
  Program boothd("boothd", daemon_arguments(), folder.path / "boothd.log");
  ASSERT_TRUE(is_ready()) << boothd.output();
  EXPECT_EQ(run("boothd", daemon_arguments()), 69) << "a second daemon on the same socket";
  EXPECT_THAT(output, HasSubstr("another boothd is running"));
  EXPECT_EQ(ask("start")["ok"], true);
  ASSERT_TRUE(eventually([&] { return ask("status")["frames"].get<int>() >= 3; }, 60s)) << ask("status").dump(2);
  const std::filesystem::path session = ask("status")["session_folder"].get<std::string>();
  EXPECT_EQ(run("boothctl", {"status", "--socket", socket}), 0);
  EXPECT_THAT(output, HasSubstr("front-left"));
  EXPECT_THAT(output, HasSubstr("\ncalibrated not known when, residual not known\ndisk  "));
  EXPECT_THAT(output, HasSubstr(" GB free where sessions are kept\n"));
  boothd.signal(SIGHUP);
  boothd.signal(SIGTERM);
  EXPECT_EQ(boothd.wait(), 0) << boothd.output();
  const json j = json::parse(read_text(session / "session.json"));
  EXPECT_EQ(j["result"], "complete");
  EXPECT_EQ(j["calibration"], "layout");
  EXPECT_EQ(j["coverage"], "full") << j["coverage_fraction"];
  EXPECT_GE(j["frames"].get<int>(), 3);
  EXPECT_TRUE(std::filesystem::exists(session / "skeleton.csv"));
  EXPECT_FALSE(std::filesystem::exists(socket));
}

TEST_F(ProgramTest, HealthGateAndMetrics) {
  EXPECT_EQ(run("boothctl", {"health", "--socket", socket}), 1);
  EXPECT_THAT(output, HasSubstr("not healthy: boothd is not running"));
  EXPECT_EQ(run("boothctl", {"health", "--gate", "--wait", "0.3", "--json", "--socket", socket}), 1);
  EXPECT_THAT(output, HasSubstr("\"healthy\":false"));
  EXPECT_EQ(run("boothctl", {"health", "--frames", "-1"}), 64);
  const std::string prom = (folder.path / "boothd.prom").string();
  EXPECT_EQ(run("boothctl", {"metrics", "--out", prom, "--socket", socket}), 0) << output;
  EXPECT_THAT(read_text(prom), HasSubstr("\nboothd_up 0\n"));

  // The gate is asked before boothd is ready, as a hook does.
  Program boothd("boothd", daemon_arguments(), folder.path / "boothd.log");
  EXPECT_EQ(run("boothctl", {"health", "--gate", "--every-camera", "--frames", "5", "--wait", "55", "--socket", socket}), 0) << output << boothd.output();
  EXPECT_THAT(output, HasSubstr("ready, idle, 4 of 4 cameras deliver"));
  EXPECT_EQ(run("boothctl", {"health", "--frames", "1000000", "--wait", "0.3", "--json", "--socket", socket}), 1);
  EXPECT_THAT(output, HasSubstr("of 1000000 frames"));
  EXPECT_EQ(run("boothctl", {"metrics", "--out", prom, "--socket", socket}), 0) << output;
  EXPECT_THAT(read_text(prom), HasSubstr("boothd_camera_up{camera=\"front-left\"} 1\n"));
  EXPECT_EQ(run("boothctl", {"metrics", "--out", "/nonexistent/x.prom", "--socket", socket}), 1);
  boothd.signal(SIGTERM);
  EXPECT_EQ(boothd.wait(), 0);
}

TEST_F(ProgramTest, ASupportBundleHasNothingOfASession) {
  Program boothd("boothd", daemon_arguments(), folder.path / "boothd.log");
  ASSERT_TRUE(is_ready()) << boothd.output();
  ask("start");
  ASSERT_TRUE(eventually([&] { return ask("status")["frames"].get<int>() >= 3; }, 60s));
  const std::string session = ask("status")["session"].get<std::string>(), bundle = (folder.path / "report.tar").string();
  auto arguments = daemon_arguments();
  arguments.insert(arguments.begin(), {"report", "--out", bundle});
  const auto calibration = folder.write("c.toml", "# from " + session + "\n" + read_text(BOOTH_SOURCE_DIR "/tests/daemon/state/version-1/calibration.toml"));
  arguments.insert(arguments.end(), {"--set", "cameras.kinect2.calibration=" + calibration.string()});
  arguments.insert(arguments.end(), {"--set", "dds.peers=[\"192.0.2.7\"]"});
  // Doctor complains of it, with its path.
  arguments.insert(arguments.end(), {"--set", "privacy.seal_to=/nonexistent/whose.public"});
  EXPECT_EQ(run("boothctl", arguments), 0) << output;
  const std::string text = read_text(bundle);
  for (const char* there : {"boothd-report/CONTENTS.txt", "\"state\"", "front-left", "[cameras.kinect2]", "usb_controllers", "501000000001"})
    EXPECT_THAT(text, HasSubstr(there));
  ASSERT_GE(session.size(), 16u);
  EXPECT_EQ(text.find(session.substr(0, 16)), std::string::npos);
  for (const char* absent : {"\"session\"", "last_session", "residual", "\"person\"", "joints", "192.0.2.7", "whose.public"})
    EXPECT_EQ(text.find(absent), std::string::npos) << absent;
  EXPECT_EQ(run("boothctl", {"report", "--out", "/nonexistent/report.tar"}), 1);
}

TEST_F(ProgramTest, WhoWaitsAtATerminalSeesForWhat) {
  if (!std::filesystem::exists("/usr/bin/script")) GTEST_SKIP() << "skipped: script(1), which stands for a terminal, is not installed";
  const ControlServer boothd(socket, [](const std::string&) { return std::string(R"({"ok":true,"state":"searching","remark":"nobody is there"})"); });
  const auto at_terminal = [&](const std::string& words, const std::string& to) {
    Program shell("/usr/bin/script", {"-qec", "'" BOOTH_BINARY_DIR "/bin/boothctl' " + words + " --socket " + to, "/dev/null"}, folder.path / "terminal");
    EXPECT_EQ(shell.wait(), 1) << shell.output();
    return shell.out();
  };
  EXPECT_THAT(at_terminal("start --wait --limit 1.2", socket),
              AllOf(HasSubstr("finding a body:   0 s  searching, nobody is there"), HasSubstr("finding a body:   1 s  ")));
  EXPECT_THAT(at_terminal("stop --wait --limit 0.2", socket), HasSubstr("saving the session:   0 s  searching"));
  EXPECT_THAT(at_terminal("health --wait 0.3", "/nowhere"), HasSubstr("waiting   0 of 0.3 s: boothd is not running"));
  EXPECT_EQ(run("boothctl", {"start", "--wait", "--limit", "0.2", "--socket", socket}), 1);
  EXPECT_THAT(output, Not(HasSubstr("0 s  searching"))) << "a pipe has the result alone";
}

TEST_F(ProgramTest, WhatIsMadeIsToldAsJson) {
  const std::string bundle = (folder.path / "report.tar").string(), base = (folder.path / "museum").string(), csv = (folder.path / "x.csv").string();
  ASSERT_EQ(run("boothctl", {"report", "--json", "--out", bundle, "--socket", socket}), 0) << output;
  json j = json::parse(output);
  EXPECT_EQ(j["ok"], true);
  EXPECT_EQ(j["file"], bundle);
  EXPECT_EQ(j["files"].size(), 8u);
  ASSERT_EQ(run("boothctl", {"key", "new", base, "--json"}), 0) << output;
  j = json::parse(output);
  EXPECT_EQ(j["private"], base + ".private");
  const std::string id = j["key"];
  ASSERT_EQ(run("boothctl", {"key", "show", base + ".public", "--json"}), 0) << output;
  j = json::parse(output);
  EXPECT_EQ(j["half"], "public");
  EXPECT_EQ(j["key"], id);
  const std::string session = BOOTH_SOURCE_DIR "/tests/daemon/state/version-1/session";
  ASSERT_EQ(run("boothctl", {"export", session, "--format", "csv", "--out", csv, "--json"}), 0) << output;
  j = json::parse(output);
  EXPECT_EQ(j["file"], csv);
  EXPECT_EQ(j["format"], "csv");
  EXPECT_TRUE(std::filesystem::exists(csv));
  // A name need not be UTF-8; what is done is told all the same.
  ASSERT_EQ(run("boothctl", {"export", session, "--format", "csv", "--out", (folder.path / "\xff.csv").string(), "--json"}), 0) << output;
  EXPECT_TRUE(json::accept(output)) << output;
}

TEST_F(ProgramTest, ASessionIsExportedToSeveralFormatsAtOnce) {
  const std::string session = BOOTH_SOURCE_DIR "/tests/daemon/state/version-1/session";
  const auto out = folder.path / "out";
  std::filesystem::create_directory(out);
  ASSERT_EQ(run("boothctl", {"export", session, "--format", "bvh,csv,glb", "--out", out.string(), "--json"}), 0) << output;
  std::istringstream lines(output);
  std::vector<std::string> formats;
  for (std::string line; std::getline(lines, line);) {
    const json j = json::parse(line);
    formats.push_back(j["format"]);
    EXPECT_EQ(j["file"], (out / ("session." + formats.back())).string());
    ASSERT_EQ(run("boothctl", {"export", session, "--format", formats.back(), "--out", (folder.path / "alone").string()}), 0) << output;
    EXPECT_EQ(read_text(out / ("session." + formats.back())), read_text(folder.path / "alone")) << formats.back();
  }
  EXPECT_EQ(formats, (std::vector<std::string>{"bvh", "csv", "glb"}));
  // Several files in one would be the last of them.
  EXPECT_EQ(run("boothctl", {"export", session, "--format", "bvh,csv", "--out", (folder.path / "both").string()}), 1);
  EXPECT_NE(output.find("is no folder"), std::string::npos) << output;
  EXPECT_FALSE(std::filesystem::exists(folder.path / "both"));
  EXPECT_EQ(run("boothctl", {"export", session, "--format", "bvh,obj", "--out", out.string()}), 64);
}

TEST_F(ProgramTest, ASupportBundleTakesNoFileThatIsNoCalibration) {
  // boothd may put a link in the calibration's place, and root writes the bundle.
  const auto secret = folder.write("shadow", "root:secret-hash:1\n");
  const auto calibration = folder.path / "calibration.toml", bundle = folder.path / "report.tar";
  std::filesystem::create_symlink(secret, calibration);
  EXPECT_EQ(run("boothctl", {"report", "--out", bundle.string(), "--socket", socket, "--set", "cameras.kinect2.calibration=" + calibration.string()}), 0)
      << output;
  EXPECT_EQ(read_text(bundle).find("secret-hash"), std::string::npos);
  EXPECT_THAT(read_text(bundle), HasSubstr("no calibration"));
}

#ifdef BOOTHD_EMULATOR
TEST_F(ProgramTest, FourEmulatedSensorsGiveATrackedSkeleton) {
  auto arguments = daemon_arguments();
  // A low rate, so that two busy cores can render, decode and fit it.
  for (const char* s : {"cameras.driver=kinect2-emulated", "cameras.emulated.rate=2"}) arguments.insert(arguments.end(), {"--set", s});
  Program boothd("boothd", arguments, folder.path / "boothd.log");
  ASSERT_TRUE(is_ready()) << boothd.output();
  EXPECT_EQ(ask("start")["ok"], true);
  ASSERT_TRUE(eventually([&] { return ask("status")["state"] == "tracking" && ask("status")["frames"].get<int>() >= 4; }, 150s))
      << ask("status").dump(2) << boothd.output();
  const std::filesystem::path session = ask("status")["session_folder"].get<std::string>();
  for (const auto& camera : ask("status")["cameras"]) {
    EXPECT_EQ(camera["state"], "running");
    EXPECT_EQ(camera["problem"], "");
    EXPECT_EQ(camera["restarts"], 0);
  }
  EXPECT_EQ(run("boothctl", {"stop", "--wait", "--socket", socket}), 0) << output;
  boothd.signal(SIGTERM);
  EXPECT_EQ(boothd.wait(), 0) << boothd.output();
  const json j = json::parse(read_text(session / "session.json"));
  EXPECT_LT(j["truth"]["joint_mean"].get<double>(), 0.03) << "the synthetic driver's figure is 7 to 10 mm; this is to catch a mirrored or shifted picture";
}
#endif

TEST_F(ProgramTest, AKilledDaemonsSessionIsMarkedInterrupted) {
  std::filesystem::path session;
  {
    Program boothd("boothd", daemon_arguments(), folder.path / "boothd.log");
    ASSERT_TRUE(is_ready()) << boothd.output();
    ask("start");
    ASSERT_TRUE(eventually([&] { return ask("status")["frames"].get<int>() >= 3; }, 60s));
    session = ask("status")["session_folder"].get<std::string>();
    std::this_thread::sleep_for(200ms);
    boothd.signal(SIGKILL);
    EXPECT_EQ(boothd.wait(), -1);
  }
  EXPECT_EQ(json::parse(read_text(session / "session.json"))["result"], "running");
  Program again("boothd", daemon_arguments(), folder.path / "again.log");
  ASSERT_TRUE(is_ready()) << again.output();
  EXPECT_EQ(json::parse(read_text(session / "session.json"))["result"], "interrupted");
  EXPECT_GE(json::parse(read_text(session / "session.json"))["frames"].get<int>(), 1);
  again.signal(SIGINT);
  EXPECT_EQ(again.wait(), 0);
}

TEST_F(ProgramTest, SystemdFindsNothingWrongWithTheUnit) {
  if (!std::filesystem::exists("/usr/bin/systemd-analyze")) GTEST_SKIP() << "systemd-analyze is not installed";
  std::string unit = read_text(BOOTH_SOURCE_DIR "/systemd/boothd.service");
  const std::string installed = "ExecStart=/usr/bin/boothd";
  ASSERT_NE(unit.find(installed), std::string::npos);
  unit.replace(unit.find(installed), installed.size(), "ExecStart=" BOOTH_BINARY_DIR "/bin/boothd");
  const auto file = folder.write("boothd.service", unit);
  const int status = std::system(("systemd-analyze verify " + file.string() + " > " + (folder.path / "verify").string() + " 2>&1").c_str());
  EXPECT_EQ(status, 0);
  EXPECT_EQ(read_text(folder.path / "verify"), "");

  // Likewise with the drop-in for boxes with a CUDA device, and it does what it says.
  std::filesystem::create_directory(folder.path / "boothd.service.d");
  std::filesystem::copy_file(BOOTH_SOURCE_DIR "/systemd/boothd.service.d/cuda.conf", folder.path / "boothd.service.d/cuda.conf");
  EXPECT_EQ(std::system(("systemd-analyze verify " + file.string() + " > " + (folder.path / "verify").string() + " 2>&1").c_str()), 0);
  EXPECT_EQ(read_text(folder.path / "verify"), "");
  if (std::system(("systemd-analyze security --offline=true " + file.string() + " > " + (folder.path / "security").string() + " 2>&1").c_str()) == 0) {
    EXPECT_NE(read_text(folder.path / "security").find("char-nvidia*:rw"), std::string::npos);
  }
}

}  // namespace
}  // namespace booth::daemon

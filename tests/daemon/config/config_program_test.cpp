// boothctl config as a person types it: statuses, sentences, and what is on the disk afterwards.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "daemon/config/load.hpp"
#include "daemon/ctl/control_server.hpp"
#include "daemon/security/fleet_folder.hpp"
#include "daemon/security/utc_time.hpp"
#include "tests/daemon/support/program.hpp"

namespace booth::daemon {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

struct ConfigProgram : ::testing::Test {
  ConfigProgram() {
    file = folder.write("etc/boothd.toml", "[dds]\nsecurity = \"on\"\nself_issued = \"" + own().string() + "\"\n[control]\nsocket = \"" + socket + "\"\n");
    folder.write("etc/boothd.toml.d/10-box.toml",
                 "[booth]\nid = \"lobby\"\n[cameras.kinect2]\ncalibration = \"" + calibration().string() + "\"\n[stage]\nradius = 1.5\n");
  }
  std::filesystem::path own() const { return folder.path / "security"; }
  std::filesystem::path calibration() const { return folder.path / "calibration.toml"; }
  int config(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "config");
    arguments.insert(arguments.end(), {"--config", file.string()});
    tests::Program program("boothctl", arguments, folder.path / "output");
    const int status = program.wait();
    output = program.output();
    return status;
  }
  Config now() const { return load_config({.file = file, .assignments = {}}); }

  tests::TemporaryFolder folder;
  const std::string socket = (folder.path / "c.sock").string();
  std::filesystem::path file;
  std::string output;
};

TEST_F(ConfigProgram, OutChangedAndIn) {
  const std::string out = (folder.path / "out.toml").string();
  ASSERT_EQ(config({"export", "--out", out, "--set", "stage.radius=2.5"}), 0) << output;
  EXPECT_EQ(config({"import", out, "--dry-run"}), 0) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("stage.radius: 1.5 -> 2.5"), HasSubstr("nothing was written")));
  EXPECT_EQ(now().stage.radius, 1.5);
  EXPECT_EQ(config({"import", out}), 0) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("stage.radius: 1.5 -> 2.5"), HasSubstr("boothd does not run"), HasSubstr(".before-")));
  EXPECT_EQ(now().stage.radius, 2.5);
  EXPECT_EQ(config({"import", out}), 0) << output;
  EXPECT_THAT(output, HasSubstr("has these values already"));
}

TEST_F(ConfigProgram, TellsProgramsWhatItTellsPeople) {
  const std::string out = (folder.path / "out.toml").string();
  ASSERT_EQ(config({"export", "--out", out, "--set", "stage.radius=2.5"}), 0) << output;
  ASSERT_EQ(config({"import", out, "--dry-run", "--json"}), 0) << output;
  const json change{{"key", "stage.radius"}, {"before", "1.5"}, {"after", "2.5"}};
  json j = json::parse(output);
  EXPECT_EQ(j["ok"], true);
  EXPECT_EQ(j["written"], false);
  EXPECT_EQ(j["changes"], json::array({change}));
  EXPECT_THAT(j["warnings"].dump(), HasSubstr("does not exist on this machine"));
  EXPECT_EQ(now().stage.radius, 1.5);
  ASSERT_EQ(config({"import", out, "--json"}), 0) << output;
  j = json::parse(output);
  EXPECT_EQ(j["written"], true);
  EXPECT_EQ(j["boothd_runs"], false);
  EXPECT_TRUE(std::filesystem::exists(j["backup"].get<std::string>())) << j;
  folder.write("calibration.toml", "x");
  ASSERT_EQ(config({"reset", "--all", "--dry-run", "--json"}), 0) << output;
  EXPECT_EQ(json::parse(output)["would_be_deleted"], json::array({calibration().string()}));
  ASSERT_EQ(config({"reset", "--all", "--confirm", "lobby", "--json"}), 0) << output;
  EXPECT_EQ(json::parse(output)["deleted"], json::array({calibration().string()}));
  EXPECT_FALSE(std::filesystem::exists(calibration()));
}

TEST_F(ConfigProgram, SaysThatARunningBoothdHasToBeStartedAnew) {
  const ControlServer boothd(socket, [](const std::string&) { return std::string(R"({"ok":true})"); });
  EXPECT_EQ(config({"reset"}), 0) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("stage.radius: 1.5 -> 2"), HasSubstr("systemctl restart boothd")));
  EXPECT_EQ(now().booth.id, "lobby");
}

TEST_F(ConfigProgram, AWrongFileChangesNothing) {
  const auto wrong = folder.write("wrong.toml", "[export]\nformat = 1\n[stage]\nradius = 99\nhight = 2\n");
  EXPECT_EQ(config({"import", wrong.string()}), 78);
  EXPECT_THAT(output, AllOf(HasSubstr("stage.radius"), HasSubstr("did you mean stage.height?"), HasSubstr("nothing was changed")));
  EXPECT_EQ(config({"import", (folder.path / "nowhere.toml").string()}), 1);
  EXPECT_THAT(output, HasSubstr("nowhere.toml"));
  EXPECT_EQ(now().stage.radius, 1.5);
}

TEST_F(ConfigProgram, StandardInputThatFailsIsNotTakenForItsEnd) {
  // Reading a folder fails, as reading a bad disk does.
  tests::Program shell("/bin/sh", {"-c", "exec \"$0\" config import - --config \"$1\" < /", BOOTH_BINARY_DIR "/bin/boothctl", file.string()},
                       folder.path / "shell");
  EXPECT_EQ(shell.wait(), 1) << shell.output();
  EXPECT_THAT(shell.err(), AllOf(HasSubstr("cannot read standard input"), HasSubstr("nothing was changed")));
}

TEST_F(ConfigProgram, TwoChangesWithinASecondKeepBothBackups) {
  const std::string out = (folder.path / "out.toml").string();
  ASSERT_EQ(config({"export", "--out", out, "--set", "stage.radius=2.5"}), 0) << output;
  ASSERT_EQ(config({"import", out}), 0) << output;
  ASSERT_EQ(config({"reset"}), 0) << output;
  std::size_t backups = 0;
  for (const auto& entry : std::filesystem::directory_iterator(file.parent_path()))
    backups += entry.path().filename().string().starts_with("boothd.toml.before-");
  EXPECT_EQ(backups, 2u);
}

TEST_F(ConfigProgram, HalfAnExportIsAFailure) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "skipped: this machine has no /dev/full";
  tests::Program shell("/bin/sh", {"-c", "exec \"$0\" config export --config \"$1\" > /dev/full", BOOTH_BINARY_DIR "/bin/boothctl", file.string()},
                       folder.path / "shell");
  EXPECT_EQ(shell.wait(), 1) << shell.output();
  EXPECT_THAT(shell.err(), HasSubstr("could not be written"));
}

TEST_F(ConfigProgram, ResettingEverythingIsMeantAndDeletesKnownFilesOnly) {
  make_fleet(own(), "local", 10, utc_seconds());
  issue(own(), {.role = Role::booth, .name = "lobby", .booths = {}}, utc_seconds());
  folder.write("security/issued/booth.lobby/notes.txt", "mine");
  folder.write("elsewhere/key.pem", "of somebody else");
  std::filesystem::create_directory_symlink(folder.path / "elsewhere", own() / "issued" / "booth.link");
  folder.write("calibration.toml", "x");
  folder.write("calibration.before-1.toml", "x");
  folder.write("other.toml", "x");
  const auto there = [&](const char* name) { return std::filesystem::exists(folder.path / name); };
  EXPECT_EQ(config({"reset", "--all"}), 64);
  EXPECT_THAT(output, HasSubstr("--confirm lobby"));
  EXPECT_EQ(config({"reset", "--all", "--confirm", "hall"}), 64);
  EXPECT_EQ(config({"reset", "--all", "--dry-run"}), 0) << output;
  EXPECT_TRUE(there("calibration.toml") && there("security/issued/booth.lobby/key.pem"));
  EXPECT_EQ(config({"reset", "--all", "--confirm", "lobby"}), 0) << output;
  EXPECT_FALSE(there("calibration.toml") || there("calibration.before-1.toml") || there("security/issued/booth.lobby/key.pem") ||
               there("security/identity_ca.key.pem"));
  EXPECT_TRUE(there("elsewhere/key.pem")) << "a link that boothd could have made leads nowhere";
  EXPECT_TRUE(there("other.toml") && there("security/issued/booth.lobby/notes.txt"));
  EXPECT_THAT(output, HasSubstr("holds other files"));
  EXPECT_EQ(now().dds.security, "on");
  EXPECT_EQ(now().booth.id, "booth");
}

TEST_F(ConfigProgram, ABoothThatForgotItsKeysCanMakeNewOnes) {
  make_fleet(own(), "local", 10, utc_seconds());
  issue(own(), {.role = Role::booth, .name = "lobby", .booths = {}}, utc_seconds());
  EXPECT_EQ(config({"reset", "--all", "--confirm", "lobby"}), 0) << output;
  EXPECT_THAT(output, Not(HasSubstr("holds other files")));
  make_fleet(own(), "local", 10, utc_seconds());
  EXPECT_TRUE(std::filesystem::exists(own() / "identity_ca.key.pem"));
}

}  // namespace
}  // namespace booth::daemon

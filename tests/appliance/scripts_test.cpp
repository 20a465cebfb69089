// The scripts that run on a box while its packages change, with stand-ins for the programs that they call: what they do, in which order, and what is left.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/house/command.hpp"

namespace booth::tests {
namespace {

namespace fs = std::filesystem;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

/// A copy of each script that sees a folder in the place of /etc/apt, /run and /var/lib; every program it calls writes itself down in "calls".
struct ScriptsTest : ::testing::Test {
  ScriptsTest() {
    for (const char* folders : {"run/systemd/system", "run/udev", "etc/apt/preferences.d", "var/lib/boothd-gate"})
      fs::create_directories(folder.path / folders);
    for (const char* program :
         {"udevadm", "systemd-sysusers", "systemd-tmpfiles", "systemctl", "deb-systemd-helper", "deb-systemd-invoke", "apt-get", "dpkg", "boothctl"})
      stands_in(program, "");
    // The models' package has boothd's version unless a test says otherwise.
    stands_in("dpkg-query", R"sh(case $4 in boothd-models) version=models ;; *) version=version ;; esac
[ -e "$here/$version" ] || version=version
case $2 in
  *Version*Status*) echo "$(cat "$here/$version") $(cat "$here/status")" ;;
  *Status*) cat "$here/status" ;;
  *) cat "$here/$version" ;;
esac)sh");
    is("status", "installed");
    is("version", "2-1");
  }
  /// A shell script in the place of a program; $here is the folder.
  void stands_in(const std::string& program, const std::string& does) const {
    const auto path =
        folder.write("bin/" + program, "#!/bin/sh\nhere='" + folder.path.string() + "'\necho \"" + program + " $*\" >>\"$here/calls\"\n" + does + "\n");
    fs::permissions(path, fs::perms::owner_all);
  }
  void is(const std::string& what, const std::string& text) const { folder.write(what, text); }
  CommandResult run(const std::string& script, const std::string& arguments = "") const {
    const auto copy = folder.path / "script";
    const std::string places = "s,/\\(etc/apt\\|etc/boothd\\|run/systemd\\|run/udev\\|var/lib/boothd\\),'" + folder.path.string() + "'/\\1,g";
    return run_in_source_tree("sed \"" + places + "\" toolchain/packaging/" + script + " >'" + copy.string() + "' && env -u STATE_DIRECTORY PATH='" +
                              (folder.path / "bin").string() + "':\"$PATH\" sh '" + copy.string() + "' " + arguments);
  }
  std::string calls() const { return text("calls"); }
  std::string text(const std::string& name) const { return fs::exists(folder.path / name) ? read_text(folder.path / name) : ""; }

  TemporaryFolder folder;
};

TEST_F(ScriptsTest, AnInstallationHandsOverWhatIsPluggedInAlready) {
  EXPECT_EQ(run("postinst", "configure ''").status, 0);
  EXPECT_THAT(calls(), ContainsRegex("udevadm control --reload\nudevadm trigger .*usb.*gpio.*\nudevadm settle"));
  EXPECT_LT(calls().find("udevadm settle"), calls().find("deb-systemd-invoke start boothd.service"));
}

TEST_F(ScriptsTest, NoSystemdAndNothingThatAnswersIsNoReasonToFail) {
  for (const char* program : {"udevadm", "systemd-tmpfiles", "systemctl", "deb-systemd-helper", "deb-systemd-invoke"}) stands_in(program, "exit 1");
  for (const bool booted : {true, false}) {
    if (!booted) fs::remove_all(folder.path / "run");
    for (const char* how : {"postinst configure ''", "postinst abort-upgrade 2-1", "postinst abort-remove", "prerm remove", "prerm upgrade 2-1"}) {
      const std::string line = how;
      const auto space = line.find(' ');
      const auto result = run(line.substr(0, space), line.substr(space + 1));
      EXPECT_EQ(result.status, 0) << how << result.output;
    }
  }
}

TEST_F(ScriptsTest, APurgeLeavesNothingOfAPersonBehindALinkEither) {
  folder.write("disk/sessions/20260101T000000Z-0001/session.json", "{}");
  folder.write("etc/boothd/boothd.toml.d/mine.toml", "");
  fs::create_directory_symlink(folder.path / "disk", folder.path / "var/lib/boothd");
  EXPECT_EQ(run("postrm", "remove").status, 0);
  EXPECT_TRUE(fs::exists(folder.path / "disk/sessions/20260101T000000Z-0001/session.json"));
  EXPECT_EQ(run("postrm", "purge").status, 0);
  EXPECT_TRUE(fs::is_empty(folder.path / "disk"));
  EXPECT_FALSE(fs::exists(fs::symlink_status(folder.path / "var/lib/boothd")));
  EXPECT_FALSE(fs::exists(folder.path / "etc/boothd"));
}

TEST_F(ScriptsTest, TheGateRemembersWhatPasses) {
  is("etc/apt/preferences.d/boothd-refused", "1-9");
  EXPECT_EQ(run("update/boothd-gate").status, 0);
  EXPECT_EQ(text("var/lib/boothd-gate/good"), "2-1\n");
  EXPECT_FALSE(fs::exists(folder.path / "var/lib/boothd-gate/good.new"));
  EXPECT_FALSE(fs::exists(folder.path / "etc/apt/preferences.d/boothd-refused"));
  fs::remove(folder.path / "calls");
  EXPECT_EQ(run("update/boothd-gate").status, 0);
  EXPECT_THAT(calls(), Not(HasSubstr("boothctl"))) << "it was found good already";
}

TEST_F(ScriptsTest, TheGateAsksAboutTheVersionThatCameWhileItAsked) {
  stands_in("boothctl", R"sh([ "$(cat "$here/version")" = 3-1 ] || { echo 3-1 >"$here/version"; exit 0; }; exit 1)sh");
  EXPECT_NE(run("update/boothd-gate").status, 0);
  EXPECT_EQ(text("var/lib/boothd-gate/good"), "") << "neither is good: 2-1 is gone, 3-1 is not healthy";
}

TEST_F(ScriptsTest, TheGateAsksAboutAPackageWhoseScriptsFailed) {
  stands_in("boothctl", "exit 1");
  is("status", "half-configured");
  EXPECT_NE(run("update/boothd-gate").status, 0);
  for (const char* gone : {"", "not-installed", "config-files"}) {
    is("status", gone);
    EXPECT_EQ(run("update/boothd-gate").status, 0) << gone;
  }
}

TEST_F(ScriptsTest, TheGateHasNoOpinionOfABoothThatSomebodySwitchedOff) {
  const auto systemctl_says = [&](const std::string& state, bool enabled) {
    stands_in("systemctl", "case $1 in show) echo " + state + " ;; is-enabled) exit " + (enabled ? "0" : "1") + " ;; esac");
  };
  stands_in("boothctl", "exit 1");
  systemctl_says("inactive", false);
  EXPECT_EQ(run("update/boothd-gate").status, 0);
  EXPECT_THAT(calls(), Not(HasSubstr("boothctl")));
  EXPECT_EQ(text("var/lib/boothd-gate/good"), "");
  for (const char* state : {"active", "failed", "activating"}) {
    systemctl_says(state, false);
    EXPECT_NE(run("update/boothd-gate").status, 0) << state;
  }
  systemctl_says("inactive", true);
  EXPECT_NE(run("update/boothd-gate").status, 0);
}

TEST_F(ScriptsTest, WhatIsTakenBackIsPinnedAwayInOneStep) {
  is("var/lib/boothd-gate/good", "1-1\n");
  EXPECT_EQ(run("update/boothd-go-back").status, 0);
  EXPECT_EQ(text("etc/apt/preferences.d/boothd-refused"), "Package: boothd boothd-models\nPin: version 2-1\nPin-Priority: -1\n");
  EXPECT_FALSE(fs::exists(folder.path / "etc/apt/preferences.d/boothd-refused.new"));
  EXPECT_THAT(calls(), ContainsRegex("dpkg --force-confold --configure -a\napt-get .*Lock::Timeout=600 .*boothd=1-1 boothd-models=1-1"));
}

TEST_F(ScriptsTest, AnUpdateEndsWithTheNewVersionHealthy) {
  stands_in("apt-get", R"(case $* in *only-upgrade*) echo 3-1 >"$here/version" ;; esac)");
  EXPECT_EQ(run("update/boothd-update").status, 0);
  EXPECT_THAT(calls(), ContainsRegex("dpkg --force-confold --configure -a\n.*boothctl health")) << "what the power cut in two is put right first";
  EXPECT_THAT(calls(), ContainsRegex("apt-get .*Lock::Timeout=600 .*Error-Mode=any update\n"));
  EXPECT_THAT(calls(), ContainsRegex("apt-get .*Lock::Timeout=600 .*only-upgrade install boothd\n"));
  EXPECT_THAT(calls(), Not(HasSubstr("boothd=")));
}

TEST_F(ScriptsTest, AnUpdateThatIsNotHealthyIsTakenBack) {
  stands_in("apt-get", R"(case $* in *only-upgrade*) echo 3-1 >"$here/version" ;; *boothd=*) echo 2-1 >"$here/version" ;; esac)");
  stands_in("boothctl", R"sh([ "$(cat "$here/version")" = 2-1 ])sh");
  const auto result = run("update/boothd-update");
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.output, HasSubstr("2-1 again, because 3-1 was not healthy"));
  EXPECT_THAT(calls(), ContainsRegex("apt-get .*Lock::Timeout=600 .*boothd=2-1 boothd-models=2-1"));
}

TEST_F(ScriptsTest, HalfAnUpdateIsTakenBack) {
  // boothd came and its models did not, or its models alone.
  for (const char* apt : {R"(case $* in *only-upgrade*) echo 3-1 >"$here/version"; exit 100 ;; *boothd=*) echo 2-1 >"$here/version" ;; esac)",
                          R"(case $* in *only-upgrade*) echo 3-1 >"$here/models"; exit 100 ;; *boothd=*) rm "$here/models" ;; esac)"}) {
    stands_in("apt-get", apt);
    const auto result = run("update/boothd-update");
    EXPECT_EQ(result.status, 1) << apt;
    EXPECT_THAT(result.output, HasSubstr("2-1 again, because the update did not come to its end")) << apt;
    EXPECT_THAT(calls(), ContainsRegex("apt-get .*boothd=2-1 boothd-models=2-1")) << apt;
    fs::remove(folder.path / "calls");
  }
}

TEST_F(ScriptsTest, AnUpdateThatCannotBeTakenBackSaysSo) {
  stands_in("apt-get", R"(case $* in *only-upgrade*) echo 3-1 >"$here/version"; exit 100 ;; *boothd=*) exit 100 ;; esac)");
  const auto result = run("update/boothd-update");
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.output, HasSubstr("not gone back: apt-get could not install 2-1"));
}

TEST_F(ScriptsTest, WithoutTheRepositoryNothingIsTheNewest) {
  stands_in("apt-get", R"(case $* in *Error-Mode=any*update) exit 100 ;; esac)");
  const auto result = run("update/boothd-update");
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.output, HasSubstr("not updated: the lists could not be fetched"));
  EXPECT_THAT(calls(), Not(HasSubstr("only-upgrade")));
}

TEST_F(ScriptsTest, NothingNewerIsNoFailure) {
  const auto result = run("update/boothd-update");
  EXPECT_EQ(result.status, 0);
  EXPECT_THAT(result.output, HasSubstr("2-1 is the newest"));
}

TEST_F(ScriptsTest, AnUpdateThatAptRefusedChangesNothing) {
  stands_in("apt-get", R"(case $* in *only-upgrade*) exit 100 ;; esac)");
  const auto result = run("update/boothd-update");
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.output, HasSubstr("not updated"));
  EXPECT_THAT(calls(), Not(HasSubstr("boothd=")));
}

}  // namespace
}  // namespace booth::tests

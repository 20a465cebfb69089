// A configuration goes out and comes back the same; whatever moment an import is interrupted at, boothd reads the old one or the new one and nothing between.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>

#include "daemon/config/change.hpp"
#include "daemon/config/keys.hpp"
#include "daemon/config/load.hpp"
#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/support/complaint.hpp"

namespace booth::daemon {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using tests::complaint;
using tests::read_text;
using tests::TemporaryFolder;

namespace fs = std::filesystem;

constexpr const char* kHead = "[export]\nformat = 1\n";

std::string all_values(const Config& config) {
  std::string out;
  for (const ConfigKey& key : config_keys()) out += std::string(key.name) + " = " + format_config_value(key, config) + "\n";
  return out;
}

/// A box as a package and an administrator leave it.
struct Box {
  Box() {
    file = folder.write("boothd.toml", "[dds]\nsecurity = \"on\"\n[session]\ndirectory = \"/var/lib/boothd/sessions\"\n");
    folder.write("boothd.toml.d/10-box.toml", "[booth]\nid = \"lobby\"\n[cameras]\nkinect2.serials = [\"1\", \"2\"]\n");
    folder.write("boothd.toml.d/20-site.toml", "# by hand\n[stage]\nradius = 1.5\n[fit]\nthreads = 4\n");
  }
  ConfigSources sources() const { return {.file = file, .assignments = {}}; }
  Config config() const { return load_config(sources()); }
  std::string exported() const { return export_text(load_settings(sources()), "0.1.0", "2026-11-28T12:00:00Z"); }
  ConfigPlan plan(const std::string& text, const ImportOptions& options = {}) const { return import_plan(sources(), text, "x.toml", options); }
  void carry_out(const ConfigPlan& p, std::size_t steps = 1000, const std::string& stamp = "now") const {
    const auto all = steps_of(p, stamp, "0.1.0", "2026-11-28T12:00:00Z");
    for (std::size_t i = 0; i < std::min(steps, all.size()); ++i) all[i]();
  }
  std::vector<std::string> files(const std::string& ending) const {
    std::vector<std::string> out;
    for (const auto& entry : fs::recursive_directory_iterator(folder.path))
      if (const std::string name = entry.path().filename().string(); entry.is_regular_file() && name.ends_with(ending)) out.push_back(name);
    std::sort(out.begin(), out.end());
    return out;
  }

  TemporaryFolder folder;
  fs::path file;
};

TEST(ConfigExport, HoldsWhatWasSetAndIsAConfigurationItself) {
  const Box box;
  const std::string text = box.exported();
  EXPECT_THAT(text, AllOf(HasSubstr("format = 1"), HasSubstr("software = \"0.1.0\""), HasSubstr("radius = 1.5"), HasSubstr("id = \"lobby\"")));
  EXPECT_THAT(text, Not(HasSubstr("height"))) << "defaults stay with the version that has them";
  const auto copy = box.folder.write("elsewhere/boothd.toml", text);
  EXPECT_EQ(all_values(load_config({.file = copy, .assignments = {}})), all_values(box.config()));
}

TEST(ConfigImport, GivesAnotherBoxTheSameConfiguration) {
  const Box from, to;
  from.folder.write("boothd.toml.d/30-more.toml",
                    "[log]\nlevel = \"debug\"\n[dds]\npeers = [\"a\", \"b\"]\nmulticast = false\n[gpio]\nchip = \"a \\\"b\\\\\"\n");
  to.folder.write("boothd.toml.d/40-other.toml", "[fit]\nseed = 9\n[booth]\nid = \"hall\"\n");
  to.carry_out(to.plan(from.exported()));
  EXPECT_EQ(all_values(to.config()), all_values(from.config()));
  EXPECT_THAT(to.files(".toml"), ElementsAre("00-imported.toml", "boothd.toml"));
  EXPECT_THAT(to.files(".before-now"), ElementsAre("10-box.toml.before-now", "20-site.toml.before-now", "40-other.toml.before-now", "boothd.toml.before-now"));
  EXPECT_THAT(read_text(to.folder.path / "boothd.toml.d/20-site.toml.before-now"), HasSubstr("# by hand"));
}

TEST(ConfigImport, IsTheOldOneOrTheNewOneAtEveryMoment) {
  for (std::size_t steps = 0;; ++steps) {
    const Box from, to;
    from.folder.write("boothd.toml.d/30-more.toml", "[log]\nlevel = \"debug\"\n[session]\ndirectory = \"/srv/sessions\"\n");
    to.folder.write("boothd.toml.d/00-imported.toml", "[fit]\nseed = 9\n");
    to.folder.write("boothd.toml.d/40-other.toml", "[booth]\nid = \"hall\"\n[cameras]\nminimum = 3\n");
    const std::string before = all_values(to.config());
    const ConfigPlan plan = to.plan(from.exported());
    const std::size_t all = steps_of(plan, "now", "", "").size();
    to.carry_out(plan, steps);
    EXPECT_EQ(all_values(to.config()), steps < 2 ? before : all_values(from.config())) << "after " << steps << " steps";
    // Whoever tries again comes to the end.
    to.carry_out(to.plan(from.exported()), 1000, "later");
    EXPECT_EQ(all_values(to.config()), all_values(from.config()));
    EXPECT_THAT(to.files(".toml"), ElementsAre("00-imported.toml", "boothd.toml"));
    if (steps >= all) break;
  }
}

TEST(ConfigImport, TheBackupTakesItBack) {
  const Box from, to;
  to.folder.write("boothd.toml.d/40-other.toml", "[booth]\nid = \"hall\"\n");
  const std::string before = all_values(to.config());
  to.carry_out(to.plan(from.exported()));
  ASSERT_NE(all_values(to.config()), before);
  to.carry_out(to.plan(read_text(to.file.string() + ".before-now")), 1000, "later");
  EXPECT_EQ(all_values(to.config()), before);
}

TEST(ConfigImport, NoBackupIsWrittenOver) {
  const Box box;
  EXPECT_EQ(free_stamp(box.file, "now"), "now");
  for (const char* name : {"boothd.toml.before-now", "boothd.toml.before-now-02"}) box.folder.write(name, "");
  EXPECT_EQ(free_stamp(box.file, "now"), "now-03");
}

TEST(ConfigImport, KeepsTenBackups) {
  const Box box;
  for (int i = 10; i < 25; ++i) {
    const std::string text = std::string(kHead) + "[fit]\nseed = " + std::to_string(i) + "\n";
    box.carry_out(box.plan(text), 1000, std::to_string(i));
  }
  std::size_t backups = 0;
  for (const auto& entry : fs::directory_iterator(box.folder.path)) backups += entry.path().filename().string().starts_with("boothd.toml.before-");
  EXPECT_EQ(backups, 10u);
  EXPECT_TRUE(fs::exists(box.file.string() + ".before-24"));
}

TEST(ConfigImport, AClockThatWasAheadCostsNoBackup) {
  const Box box;
  const auto backup = [&](const std::string& stamp) { return fs::path(box.file.string() + ".before-" + stamp); };
  for (int i = 10; i < 20; ++i) {
    const fs::path path = box.folder.write("boothd.toml.before-203601" + std::to_string(i), "");
    fs::last_write_time(path, fs::file_time_type::clock::now() + std::chrono::hours(87'600 + i));
  }
  const auto change = [&](int seed) {
    box.carry_out(box.plan(std::string(kHead) + "[fit]\nseed = " + std::to_string(seed) + "\n"), 1000, "202611" + std::to_string(seed));
  };
  change(10);
  EXPECT_TRUE(fs::exists(backup("20261110"))) << "it was just promised";
  EXPECT_FALSE(fs::exists(backup("20360110")));
  change(11);
  change(12);
  for (const char* stamp : {"20261110", "20261111", "20261112", "20360119"}) EXPECT_TRUE(fs::exists(backup(stamp))) << stamp;
  EXPECT_FALSE(fs::exists(backup("20360112")));
}

TEST(ConfigImport, WhatItWroteIsReadByTheVersionBefore) {
  const Box box;
  box.carry_out(box.plan(std::string(kHead) + "[fit]\nseed = 5\n"));
  const fs::path written = box.file.string() + ".d/00-imported.toml";
  std::string text = read_text(written);
  const std::string ours = "version = " + std::to_string(kConfigVersion) + "\n";
  ASSERT_NE(text.find(ours), std::string::npos) << text;
  // As the next version would have written it: this one has to start with it when that is taken back.
  text.replace(text.find(ours), ours.size(), "version = " + std::to_string(kConfigVersion + 1) + "\n");
  box.folder.write("boothd.toml.d/00-imported.toml", text + "a_key_of_tomorrow = 1\n");
  std::vector<std::string> warnings;
  EXPECT_EQ(load_config({.file = box.file, .assignments = {}}, &warnings).fit.seed, 5);
  EXPECT_FALSE(warnings.empty());
}

TEST(ConfigImport, TakesWhatTheNextVersionExportedAndSaysWhatItPassesOver) {
  const Box box;
  std::string text = export_text(load_settings(box.sources()), "9.0.0", "2026-11-28T12:00:00Z");
  const auto raise = [&](const std::string& key, std::int64_t by) {
    const auto at = text.find(key + std::to_string(by));
    ASSERT_NE(at, std::string::npos) << text;
    text.replace(at, key.size() + 1, key + std::to_string(by + 1));
  };
  raise("\nversion = ", kConfigVersion);
  raise("\nformat = ", kExportFormat);
  text += "a_key_of_tomorrow = 1\n";
  const ConfigPlan plan = box.plan(text);
  EXPECT_EQ(all_values(plan.after.config), all_values(box.config()));
  EXPECT_THAT(plan.notes, AllOf(Contains(HasSubstr("is of version 2")), Contains(HasSubstr("export.format: is of version 2")),
                                Contains(HasSubstr("a_key_of_tomorrow: is not a key of this version"))));
}

TEST(ConfigImport, TellsWhatChanges) {
  const Box box;
  const ConfigPlan plan =
      box.plan(std::string(kHead) + "[booth]\nid = \"lobby\"\n[stage]\nradius = 2.5\n[fit]\nthreads = 4\n[cameras.kinect2]\nserials = [\"1\", \"2\"]\n");
  const auto changes = changes_of(plan);
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].key, "stage.radius");
  EXPECT_EQ(changes[0].before, "1.5");
  EXPECT_EQ(changes[0].after, "2.5");
}

TEST(ConfigImport, RefusesTheWholeForEveryMistakeInIt) {
  const Box box;
  const std::string before = all_values(box.config());
  const std::string text = std::string(kHead) + "[stage]\nradius = 99\n[fit]\nthread = 2\n[log]\nlevel = 3\n";
  EXPECT_THAT(complaint([&] { box.plan(text); }), AllOf(HasSubstr("x.toml:4: stage.radius"), HasSubstr("fit.thread"), HasSubstr("log.level")));
  EXPECT_THAT(complaint([&] { box.plan("[fit]\nthreads = 2\n"); }), HasSubstr("[export] is missing"));
  EXPECT_THAT(complaint([&] { box.plan(""); }), HasSubstr("[export] is missing"));
  EXPECT_THAT(complaint([&] { box.plan("export = 1\n"); }), HasSubstr("must be the table"));
  EXPECT_THAT(complaint([&] { box.plan("[export]\nformat = 3\n"); }), HasSubstr("x.toml:1: export.format: is of version 3"));
  EXPECT_THAT(complaint([&] { box.plan("[export]\nformat = 0\n"); }), HasSubstr("must be the table"));
  EXPECT_THAT(complaint([&] { box.plan("[export\n"); }), HasSubstr("not TOML"));
  EXPECT_THAT(complaint([&] { box.plan(std::string(kHead) + "[cameras]\ndriver = \"recording\"\n"); }), HasSubstr("cameras.recording.path"))
      << "values that do not go together";
  EXPECT_THAT(complaint([&] { box.plan(std::string(2 << 20, '#')); }), HasSubstr("at most"));
  EXPECT_THAT(complaint([&] { import_plan({.file = box.folder.path / "nowhere.toml", .assignments = {}}, kHead, "x", {}); }), HasSubstr("does not exist"));
  EXPECT_EQ(all_values(box.config()), before);
  EXPECT_THAT(box.files(".before-now"), IsEmpty());
}

TEST(ConfigImport, MayLeaveOutWhatAnotherVersionKnows) {
  const Box box;
  const std::string text = std::string(kHead) + "[fit]\nseed = 5\nfuture = 2\n[moon]\nphase = 1\n";
  EXPECT_THAT(complaint([&] { box.plan(text); }), HasSubstr("moon"));
  const ConfigPlan plan = box.plan(text, {.known_only = true});
  EXPECT_EQ(plan.after.config.fit.seed, 5);
  EXPECT_THAT(plan.notes, AllOf(Contains(HasSubstr("fit.future")), Contains(HasSubstr("moon"))));
  EXPECT_THAT(complaint([&] { box.plan(text + "[stage]\nradius = 99\n", {.known_only = true}); }), HasSubstr("stage.radius"))
      << "a wrong value stays a mistake";
}

TEST(ConfigImport, KeepsTheBoxWhereAsked) {
  const Box box;
  const std::string text = std::string(kHead) + "[booth]\nid = \"other\"\n[cameras.kinect2]\nserials = [\"9\"]\n[fit]\nseed = 5\n";
  const ConfigPlan plan = box.plan(text, {.keep_box = true});
  EXPECT_EQ(plan.after.config.booth.id, "lobby");
  EXPECT_THAT(plan.after.config.cameras.kinect2.serials, ElementsAre("1", "2"));
  EXPECT_EQ(plan.after.config.fit.seed, 5);
  box.carry_out(plan);
  EXPECT_EQ(box.config().booth.id, "lobby");
}

TEST(ConfigImport, SilenceDoesNotSwitchSecurityOff) {
  const Box box;
  box.folder.write("boothd.toml.d/30-seal.toml", "[privacy]\nseal_to = \"/etc/boothd/key.pub\"\n");
  box.carry_out(box.plan(std::string(kHead) + "[fit]\nseed = 5\n"));
  EXPECT_EQ(box.config().dds.security, "on");
  EXPECT_EQ(box.config().privacy.seal_to, "/etc/boothd/key.pub");
  box.carry_out(box.plan(std::string(kHead) + "[dds]\nsecurity = \"off\"\n"), 1000, "later");
  EXPECT_EQ(box.config().dds.security, "off") << "who says so means it";
}

TEST(ConfigImport, MendsABrokenConfiguration) {
  const Box from, to;
  to.folder.write("boothd.toml", "[dds]\nsecurity = \"on\"\n[stage\n");
  to.folder.write("boothd.toml.d/30-bad.toml", "radius = \"?\"\n");
  const ConfigPlan plan = to.plan(from.exported());
  EXPECT_TRUE(plan.replaces_file);
  EXPECT_THAT(plan.notes, Contains(HasSubstr("boothd.toml has mistakes")));
  to.carry_out(plan);
  EXPECT_EQ(all_values(to.config()), all_values(from.config()));
  EXPECT_THAT(read_text(to.file.string() + ".broken-now"), HasSubstr("[stage"));
}

TEST(ConfigImport, RefusesADropInThatWouldWin) {
  const Box box;
  box.folder.write("boothd.toml.d/zzz.toml", "[fit]\nseed = 5\n");
  EXPECT_THAT(complaint([&] { box.plan(kHead); }), AllOf(HasSubstr("zzz.toml"), HasSubstr("rename it")));
}

TEST(ConfigReset, KeepsWhoTheBoothIsAndHowItIsSecured) {
  const Box box;
  box.carry_out(reset_plan(box.sources(), false));
  Config expected;
  expected.booth.id = "lobby";
  expected.cameras.kinect2.serials = {"1", "2"};
  expected.dds.security = "on";
  EXPECT_EQ(all_values(box.config()), all_values(expected));
}

TEST(ConfigReset, OfEverythingLeavesSecurityOn) {
  const Box box;
  box.carry_out(reset_plan(box.sources(), true));
  Config expected;
  expected.dds.security = "on";
  EXPECT_EQ(all_values(box.config()), all_values(expected));
}

TEST(ConfigReset, OfWhatCannotBeReadSwitchesSecurityOn) {
  const Box box;
  box.folder.write("boothd.toml", "[dds]\nsecurity = \"on\"\n[stage\n");
  box.carry_out(reset_plan(box.sources(), false));
  EXPECT_EQ(box.config().dds.security, "on");
}

TEST(ConfigChange, NamesFilesThatAreNotHere) {
  Config config;
  config.cameras.kinect2.calibration = "/nowhere/calibration.toml";
  EXPECT_THAT(missing_files(config), ElementsAre("cameras.kinect2.calibration: /nowhere/calibration.toml"));
}

}  // namespace
}  // namespace booth::daemon

// The units as systemd sees them: without a mistake, and with as few rights as was promised.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <set>
#include <sstream>

#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/house/command.hpp"

namespace booth::tests {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

const fs::path kUnits = fs::path(BOOTH_SOURCE_DIR) / "systemd";

/// The units in a folder of their own, as installed but for the programs, which are not here.
struct UnitsTest : ::testing::Test {
  void SetUp() override {
    if (!has_program("systemd-analyze")) GTEST_SKIP() << "skipped: systemd-analyze is not installed";
    for (const auto& entry : fs::directory_iterator(kUnits)) {
      const std::string ending = entry.path().extension();
      if (ending != ".service" && ending != ".path" && ending != ".slice") continue;
      folder.write(entry.path().filename(), std::regex_replace(read_text(entry.path()), std::regex("ExecStart=/usr/[a-z/-]+"), "ExecStart=/bin/true"));
      names.insert(entry.path().filename());
    }
  }
  void drop_in(const std::string& name) const { folder.write("boothd.service.d/" + name, read_text(kUnits / "boothd.service.d" / name)); }
  CommandResult verify(const std::string& unit) const {
    return run_in_source_tree("cd '" + folder.path.string() + "' && systemd-analyze verify --man=no ./'" + unit + "'");
  }
  /// In tenths, as systemd-analyze counts its threshold; -1 when it says none.
  int exposure(const std::string& unit) const {
    const auto result = run_in_source_tree("cd '" + folder.path.string() + "' && systemd-analyze security --offline=true --no-pager ./'" + unit + "'");
    std::smatch found;
    if (!std::regex_search(result.output, found, std::regex("Overall exposure level for [^:]*: ([0-9]+)\\.([0-9])"))) {
      ADD_FAILURE() << result.output;
      return -1;
    }
    return std::stoi(found[1]) * 10 + std::stoi(found[2]);
  }

  TemporaryFolder folder;
  std::set<std::string> names;
};

TEST_F(UnitsTest, AreWithoutAMistake) {
  ASSERT_GE(names.size(), 5u);
  for (const std::string& name : names) {
    const auto result = verify(std::regex_replace(name, std::regex("@"), "@port"));
    EXPECT_EQ(result.status, 0) << name;
    EXPECT_EQ(result.output, "") << name;
  }
}

TEST_F(UnitsTest, AMistakeWouldBeSeen) {
  folder.write("boothd.slice", "[Slice]\nMemoryMxa=4G\n");
  EXPECT_THAT(verify("boothd.slice").output, HasSubstr("MemoryMxa"));
}

TEST_F(UnitsTest, DropInsAreWithoutAMistake) {
  for (const auto& entry : fs::directory_iterator(kUnits / "boothd.service.d")) drop_in(entry.path().filename());
  const auto result = verify("boothd.service");
  EXPECT_EQ(result.status, 0);
  EXPECT_EQ(result.output, "");
}

TEST_F(UnitsTest, ExamplesForUpdatesAreWithoutAMistake) {
  const fs::path update = fs::path(BOOTH_SOURCE_DIR) / "toolchain/packaging/update";
  std::set<std::string> examples;
  for (const auto& entry : fs::directory_iterator(update)) {
    if (entry.path().extension() != ".service") continue;
    folder.write(entry.path().filename(), std::regex_replace(read_text(entry.path()), std::regex("ExecStart=/usr/[a-z/-]+"), "ExecStart=/bin/true"));
    examples.insert(entry.path().filename());
  }
  EXPECT_EQ(examples.size(), 3u);
  for (const std::string& name : examples) {
    const auto result = verify(name);
    EXPECT_EQ(result.status, 0) << name;
    EXPECT_EQ(result.output, "") << name;
  }
}

TEST_F(UnitsTest, BoothdIsExposedAsLittleAsWasPromised) {
  EXPECT_LE(exposure("boothd.service"), 12);
  EXPECT_GE(exposure("boothd.service"), 1) << "this test reads nothing";
}

TEST_F(UnitsTest, WithRealTimeScheduleItIsLittleMore) {
  drop_in("realtime.conf");
  EXPECT_LE(exposure("boothd.service"), 14);
}

TEST_F(UnitsTest, AGraphicsProcessorAndCredentialsExposeNothingMore) {
  drop_in("cuda.conf");
  drop_in("dds-security.conf");
  EXPECT_LE(exposure("boothd.service"), 12);
}

TEST_F(UnitsTest, AGraphicsProcessorRelaxesTheListOfDevicesAndNothingElse) {
  std::istringstream lines(read_text(kUnits / "boothd.service.d/cuda.conf"));
  std::vector<std::string> of_service;
  bool service = false;
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    if (line[0] == '[')
      service = line == "[Service]";
    else if (service)
      of_service.push_back(line);
  }
  EXPECT_EQ(of_service, std::vector<std::string>{"DeviceAllow=char-nvidia* rw"});
  const std::string unit = read_text(kUnits / "boothd.service");
  for (const char* kept : {"MemoryDenyWriteExecute=yes", "DevicePolicy=closed"}) EXPECT_THAT(unit, HasSubstr(kept));
}

TEST_F(UnitsTest, WhatStandsBesideBoothdIsExposedLessStill) {
  EXPECT_LE(exposure("boothd-failed.service"), 5);
  EXPECT_LE(exposure("boothd-usb-recover@.service"), 10);
}

TEST_F(UnitsTest, TheUserAndTheFoldersAreWellFormed) {
  if (!has_program("systemd-sysusers") || !has_program("systemd-tmpfiles")) GTEST_SKIP() << "skipped: systemd-sysusers or systemd-tmpfiles is not installed";
  if (run_in_source_tree("test $(id -u) = 0").status != 0) GTEST_SKIP() << "skipped: making users in a planted root needs root";
  const auto root = folder.path / "root";
  folder.write("root/etc/passwd", "root:x:0:0:root:/root:/bin/sh\n");
  folder.write("root/etc/group", "root:x:0:\n");
  const auto users = run_in_source_tree("systemd-sysusers --root='" + root.string() + "' - <systemd/boothd.sysusers");
  EXPECT_EQ(users.status, 0) << users.output;
  EXPECT_THAT(read_text(root / "etc/passwd"), HasSubstr("boothd:x:"));
  EXPECT_THAT(read_text(root / "etc/passwd"), HasSubstr(":/var/lib/boothd:/usr/sbin/nologin"));
  const auto folders = run_in_source_tree("systemd-tmpfiles --root='" + root.string() + "' --create - <systemd/boothd.tmpfiles");
  EXPECT_EQ(folders.status, 0) << folders.output;
  EXPECT_EQ(fs::status(root / "etc/boothd/credentials").permissions(), fs::perms::owner_all);
}

TEST_F(UnitsTest, WhatIsStartedWithBoothdIsStartedAsOftenAsBoothd) {
  EXPECT_THAT(read_text(kUnits / "boothd-usb-recover@.path"), HasSubstr("\nPartOf=boothd.service\n"));
  EXPECT_THAT(read_text(kUnits / "boothd-usb-recover@.path"), HasSubstr("\nStartLimitIntervalSec=0\n"));
}

TEST_F(UnitsTest, EveryStepOfTheUnitIsOneThatTheProgramKnows) {
  // boothd.service starts one path for each; the program's own list is tests/drivers/usb/recover_request_test.cpp.
  const std::string unit = read_text(kUnits / "boothd.service");
  for (const char* step : {"port", "controller", "usbfs-memory"}) EXPECT_THAT(unit, HasSubstr("boothd-usb-recover@" + std::string(step) + ".path"));
}

}  // namespace
}  // namespace booth::tests

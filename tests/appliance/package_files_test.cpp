// What lands where on a box, which scripts run there, and how the programs are built.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>

#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/house/command.hpp"

namespace booth::tests {
namespace {

namespace fs = std::filesystem;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

/// What CMake would install of a component, from the install scripts of this build: programs need not be built.
std::string install_script() { return read_text(fs::path(BOOTH_BINARY_DIR) / "cmake_install.cmake"); }

TEST(PackageFiles, EveryUnitRuleAndListIsInstalled) {
  const std::string script = install_script();
  for (const auto& entry : fs::directory_iterator(fs::path(BOOTH_SOURCE_DIR) / "systemd")) {
    const std::string name = entry.path().filename();
    if (name == "README.md") continue;
    EXPECT_THAT(script, HasSubstr("/systemd/" + name)) << name << " is in systemd/ and in no package; run cmake again where it is new";
  }
}

TEST(PackageFiles, ThePageOnUpdatesNamesExamplesThatThereAre) {
  const std::string page = read_text(fs::path(BOOTH_SOURCE_DIR) / "docs/guide/operate.md");
  EXPECT_THAT(install_script(), HasSubstr("/packaging/update"));
  for (const auto& entry : fs::directory_iterator(fs::path(BOOTH_SOURCE_DIR) / "toolchain/packaging/update"))
    EXPECT_THAT(page, HasSubstr(entry.path().filename().string()));
}

TEST(PackageFiles, WhatRunsAsRootIsInstalledWhereItsUnitStartsIt) {
  EXPECT_THAT(read_text(fs::path(BOOTH_SOURCE_DIR) / "systemd/boothd-usb-recover@.service"), HasSubstr("ExecStart=/usr/lib/boothd/boothd-usb-recover %i"));
  EXPECT_THAT(install_script(), HasSubstr("/lib/boothd"));
}

TEST(PackageFiles, MaintainerScriptsAreCleanToShellcheck) {
  if (!has_program("shellcheck")) GTEST_SKIP() << "skipped: shellcheck is not installed";
  const auto result = run_in_source_tree("shellcheck $(grep -lsE '^#!/bin/(ba)?sh' toolchain/packaging/* toolchain/packaging/update/*)");
  EXPECT_EQ(result.status, 0) << result.output;
}

TEST(PackageFiles, EveryConffileIsInstalled) {
  std::istringstream conffiles(read_text(fs::path(BOOTH_SOURCE_DIR) / "toolchain/packaging/conffiles"));
  for (std::string path; std::getline(conffiles, path);)
    EXPECT_TRUE(fs::exists(fs::path(BOOTH_SOURCE_DIR) / "toolchain/packaging" / fs::path(path).filename())) << path;
}

TEST(PackageFiles, TheConfigurationOfThePackageIsOne) {
  const fs::path boothd = fs::path(BOOTH_BINARY_DIR) / "bin/boothd";
  if (!fs::exists(boothd)) GTEST_SKIP() << "skipped: " << boothd << " is not built";
  const auto result = run_in_source_tree("'" + boothd.string() + "' --config toolchain/packaging/boothd.toml --check-config");
  EXPECT_EQ(result.status, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("directory = \"/var/lib/boothd/sessions\""));
}

// The packages' programs have all of Debian's hardening, and toolchain/package checks it; this is what every build has.

TEST(PackageFiles, ProgramsArePositionIndependentAndBoundAtTheStart) {
  if (!has_program("readelf")) GTEST_SKIP() << "skipped: readelf is not installed";
  for (const char* program : {"boothd", "boothctl", "boothd-usb-recover"}) {
    const fs::path path = fs::path(BOOTH_BINARY_DIR) / "bin" / program;
    if (!fs::exists(path)) continue;
    const auto result = run_in_source_tree("readelf --wide --dynamic --segments '" + path.string() + "'");
    ASSERT_EQ(result.status, 0) << result.output;
    EXPECT_THAT(result.output, ContainsRegex("FLAGS_1.*NOW.*PIE")) << program;
    EXPECT_THAT(result.output, HasSubstr("GNU_RELRO")) << program;
    EXPECT_THAT(result.output, Not(ContainsRegex("GNU_STACK.* RWE "))) << program;
  }
}

TEST(PackageFiles, WhatRunsAsRootPassesHardeningCheck) {
  if (!has_program("hardening-check")) GTEST_SKIP() << "skipped: hardening-check is not installed (apt-get install devscripts)";
  const fs::path root = fs::path(BOOTH_BINARY_DIR) / "bin/boothd-usb-recover";
  if (!fs::exists(root)) GTEST_SKIP() << "skipped: " << root << " is not built";
  const auto result = run_in_source_tree("hardening-check --nocfprotection --nofortify --nostackprotector '" + root.string() + "'");
  EXPECT_EQ(result.status, 0) << result.output;
}

}  // namespace
}  // namespace booth::tests

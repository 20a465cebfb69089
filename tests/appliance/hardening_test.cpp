// What the programs that are installed are protected with: in every build what a linker gives, in the packages' programs everything that Debian knows.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/house/command.hpp"

namespace booth::tests {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kPrograms[] = {"boothd", "boothctl", "boothd-usb-recover"};

struct Hardening : ::testing::TestWithParam<const char*> {
  void SetUp() override {
    if (!has_program("hardening-check")) GTEST_SKIP() << "skipped: hardening-check is not installed (apt-get install devscripts)";
  }
  static CommandResult check(const fs::path& program, const std::string& options) {
    return run_in_source_tree("hardening-check " + options + " '" + program.string() + "'");
  }
};

/// Stack protector and fortified libc calls are flags of the packages: toolchain/package.
TEST_P(Hardening, EveryBuildIsPositionIndependentAndReadOnlyAfterTheStart) {
  const fs::path program = fs::path(BOOTH_BINARY_DIR) / "bin" / GetParam();
  if (!fs::exists(program)) GTEST_SKIP() << "skipped: " << program << " is not built";
  const auto result = check(program, "--nocfprotection --nofortify --nostackprotector");
  EXPECT_EQ(result.status, 0) << result.output;
}

TEST_P(Hardening, WhatIsPackagedHasEverything) {
  const fs::path program = fs::path(BOOTH_SOURCE_DIR) / "build/package/bin" / GetParam();
  if (!fs::exists(program)) GTEST_SKIP() << "skipped: " << program << " is not built (toolchain/package)";
  const auto result = check(program, "--nocfprotection");
  EXPECT_EQ(result.status, 0) << result.output;
}

/// A folder in the list of where libraries are looked for is a folder from which code can be slipped in.
TEST_P(Hardening, NoLibraryIsLookedForOutsideTheSystem) {
  const fs::path program = fs::path(BOOTH_SOURCE_DIR) / "build/package/bin" / GetParam();
  if (!fs::exists(program)) GTEST_SKIP() << "skipped: " << program << " is not built (toolchain/package)";
  const auto result = run_in_source_tree("readelf --wide --dynamic '" + program.string() + "'");
  EXPECT_THAT(result.output, Not(HasSubstr("RUNPATH")));
  EXPECT_THAT(result.output, Not(HasSubstr("RPATH")));
}

std::string test_name(const ::testing::TestParamInfo<const char*>& program) {
  std::string name = program.param;
  std::erase(name, '-');
  return name;
}
INSTANTIATE_TEST_SUITE_P(Programs, Hardening, ::testing::ValuesIn(kPrograms), test_name);

/// Why control-flow protection is not asked for. When this fails, Debian's start files have the mark: ask for it then (toolchain/package,
/// docs/design/hardening.md).
TEST(ControlFlow, CannotTakeEffectBecauseDebiansStartFilesAreNotMarked) {
  if (run_in_source_tree("uname -m").output != "x86_64\n") GTEST_SKIP() << "skipped: the mark is x86-64's";
  const auto marks = run_in_source_tree("readelf --wide --notes \"$(gcc -print-file-name=crt1.o)\"");
  if (marks.status != 0) GTEST_SKIP() << "skipped: gcc or readelf is not installed";
  EXPECT_THAT(marks.output, Not(HasSubstr("IBT"))) << marks.output;
}

}  // namespace
}  // namespace booth::tests

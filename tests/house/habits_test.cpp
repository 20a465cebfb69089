// What every folder and every file of the house has.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "tests/house/command.hpp"
#include "tests/house/dependency_rule.hpp"

namespace booth::tests {
namespace {

const std::vector<std::string> kSourceFolders{"hal", "fit", "drivers", "daemon", "tests"};
const std::filesystem::path kRoot = BOOTH_SOURCE_DIR;

TEST(Habits, TopLevelHasWhatAVisitorLooksFor) {
  for (const char* name : {"CMakeLists.txt", "CMakePresets.json", "README.md", "LICENSE", "NOTICE", "CHANGELOG.md", "CONTRIBUTING.md", ".clang-format",
                           ".clang-tidy", ".ci/run", "toolchain/run", "toolchain/test"})
    EXPECT_TRUE(std::filesystem::exists(kRoot / name)) << name;
}

TEST(Habits, EachTopLevelFolderHasAReadme) {
  for (const char* name : {"hal", "drivers", "fit", "daemon", "systemd", "tests", "toolchain", "docs"})
    EXPECT_TRUE(std::filesystem::exists(kRoot / name / "README.md")) << name;
}

/// True when the file begins with a // comment that is a sentence: it ends with a full stop before the first blank or code line.
bool begins_with_a_sentence(const std::string& contents) {
  std::istringstream in(contents);
  std::string text, line;
  while (std::getline(in, line) && line.rfind("//", 0) == 0) text += line.substr(2) + " ";
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text.size() > 12 && text.find('.') != std::string::npos;
}

TEST(Habits, EachFileSaysInOneSentenceWhyItExists) {
  EXPECT_TRUE(begins_with_a_sentence("// A sentence that says why this exists.\n#pragma once\n"));
  EXPECT_FALSE(begins_with_a_sentence("#pragma once\n// A sentence that comes too late.\n"));
  EXPECT_FALSE(begins_with_a_sentence("// file\n"));
  for (const auto& [path, contents] : read_sources(kRoot, kSourceFolders)) EXPECT_TRUE(begins_with_a_sentence(contents)) << path;
}

TEST(Habits, NoFileIsLongerThan700Lines) {
  for (const auto& [path, contents] : read_sources(kRoot, kSourceFolders)) EXPECT_LE(std::count(contents.begin(), contents.end(), '\n'), 700) << path;
}

TEST(Habits, SourcesAreLaidOutByClangFormat) {
  if (!has_program("clang-format")) GTEST_SKIP() << "skipped: clang-format is not installed";
  const CommandResult result = run_in_source_tree("toolchain/format --check");
  EXPECT_EQ(result.status, 0) << result.output;
}

TEST(Habits, ShellScriptsAreCleanToShellcheck) {
  if (!has_program("shellcheck")) GTEST_SKIP() << "skipped: shellcheck is not installed";
  const CommandResult result = run_in_source_tree("shellcheck $(grep -lE '^#!/bin/(ba)?sh' toolchain/* .ci/* 2>/dev/null)");
  EXPECT_EQ(result.status, 0) << result.output;
}

TEST(Habits, NothingNamesTheWorkplaceItWasMadeIn) {
  // Absolute paths of somebody's machine help nobody else.
  const CommandResult result =
      run_in_source_tree("git grep -nE '/(work|home|root)/[a-z]' -- ':!tests/house/habits_test.cpp' ':!docs/reference/dependencies.md'");
  if (result.status == 128) GTEST_SKIP() << "skipped: not a git checkout";
  EXPECT_EQ(result.status, 1) << result.output;
}

}  // namespace
}  // namespace booth::tests

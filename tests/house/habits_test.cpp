// What every folder and every file of the house has.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

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

/// Targets of [text](target) that are files of ours, without their #anchors.
std::vector<std::string> links_of(const std::string& page) {
  std::vector<std::string> out;
  for (std::size_t at = page.find("]("); at != std::string::npos; at = page.find("](", at + 2)) {
    std::string target = page.substr(at + 2, page.find(')', at) - at - 2);
    target.resize(std::min(target.size(), target.find('#')));
    if (!target.empty() && target.find("://") == std::string::npos) out.push_back(target);
  }
  return out;
}

TEST(Habits, EachPresetConfiguresBuildsAndTests) {
  std::ifstream in(kRoot / "CMakePresets.json");
  const auto presets = nlohmann::json::parse(in);
  const auto named = [&](const char* kind) {
    std::set<std::string> out;
    for (const auto& preset : presets.at(kind))
      if (!preset.value("hidden", false)) out.insert(preset.at("name").get<std::string>());
    return out;
  };
  EXPECT_GE(named("configurePresets").size(), 8u);
  EXPECT_EQ(named("buildPresets"), named("configurePresets"));
  EXPECT_EQ(named("testPresets"), named("configurePresets"));
}

TEST(Habits, LinksBetweenPagesLeadSomewhere) {
  EXPECT_EQ(links_of("[a](b.md) and [c](d/e.md#f), [g](https://h.i), [j](#k)"), (std::vector<std::string>{"b.md", "d/e.md"}));
  std::vector<std::filesystem::path> pages;
  for (const auto& entry : std::filesystem::directory_iterator(kRoot))
    if (entry.path().extension() == ".md") pages.push_back(entry.path());
  for (const char* folder : {"hal", "drivers", "fit", "daemon", "systemd", "tests", "toolchain", "docs"})
    for (const auto& entry : std::filesystem::recursive_directory_iterator(kRoot / folder))
      if (entry.path().extension() == ".md") pages.push_back(entry.path());
  EXPECT_GT(pages.size(), 10u);
  for (const auto& page : pages) {
    std::ifstream in(page, std::ios::binary);
    for (const std::string& target : links_of({std::istreambuf_iterator<char>(in), {}}))
      EXPECT_TRUE(std::filesystem::exists(page.parent_path() / target)) << page << " links to " << target;
  }
}

/// toml++ 3.3 cannot stand every text; hal/toml_shape.hpp keeps those from it.
TEST(Habits, TomlIsParsedInOnePlaceOfEachRoom) {
  std::vector<std::string> places;
  for (const auto& [path, contents] : read_sources(kRoot, {"hal", "fit", "drivers", "daemon"}))
    if (contents.find("toml::parse(") != std::string::npos || contents.find("toml::parse_file") != std::string::npos) places.push_back(path);
  EXPECT_EQ(places, (std::vector<std::string>{"daemon/config/toml_document.hpp", "drivers/recording/toml_document.hpp"}));
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

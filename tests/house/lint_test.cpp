// cppcheck finds nothing in the sources but what is written down with its reason, and every fuzz target is in the page about them.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/house/command.hpp"

namespace booth::tests {
namespace {

TEST(Lint, CppcheckFindsNothing) {
  if (!has_program("cppcheck")) GTEST_SKIP() << "skipped: cppcheck is not installed";
  const CommandResult result = run_in_source_tree("toolchain/lint --cppcheck");
  EXPECT_EQ(result.status, 0) << result.output;
}

TEST(Lint, WouldFindSomething) {
  if (!has_program("cppcheck")) GTEST_SKIP() << "skipped: cppcheck is not installed";
  const std::string file = BOOTH_BINARY_DIR "/planted_mistake.cpp";
  std::ofstream(file) << "int last() {\n  int values[4] = {1, 2, 3, 4};\n  return values[4];\n}\n";
  const CommandResult result = run_in_source_tree("cppcheck -q --suppressions-list=toolchain/cppcheck.suppressions --error-exitcode=1 '" + file + "'");
  EXPECT_EQ(result.status, 1) << result.output;
}

TEST(FuzzTargets, AreAllInThePageAndHaveACorpus) {
  const std::filesystem::path root = BOOTH_SOURCE_DIR;
  std::ifstream in(root / "docs/design/hostile-input.md");
  const std::string page(std::istreambuf_iterator<char>(in), {});
  int targets = 0;
  for (const auto& entry : std::filesystem::directory_iterator(root / "tests/fuzz")) {
    if (!entry.is_directory()) continue;
    const std::string name = entry.path().filename().string();
    ++targets;
    EXPECT_NE(page.find("`" + name + "`"), std::string::npos) << name << " is not in docs/design/hostile-input.md";
    EXPECT_TRUE(std::filesystem::exists(entry.path() / (name + "_fuzz.cpp"))) << name;
    EXPECT_FALSE(std::filesystem::is_empty(entry.path() / "corpus")) << name;
  }
  EXPECT_GT(targets, 20);
}

TEST(Lint, EverySuppressionHasItsReason) {
  std::ifstream in(BOOTH_SOURCE_DIR "/toolchain/cppcheck.suppressions");
  bool reason = false;
  for (std::string line; std::getline(in, line);) {
    if (line.empty()) reason = false;
    if (line.starts_with("#")) reason = true;
    EXPECT_TRUE(reason || line.empty()) << line;
  }
}

}  // namespace
}  // namespace booth::tests

// Mistakes in a configuration are named by file, line and key, with what is allowed; what is right is taken over.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "daemon/config/keys.hpp"
#include "daemon/config/load.hpp"
#include "drivers/synthetic/motions.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using tests::TemporaryFolder;

std::vector<std::string> problems_of(const ConfigSources& sources) {
  try {
    load_config(sources);
  } catch (const ConfigError& e) {
    return e.problems();
  }
  return {};
}

std::vector<std::string> problems_in(const std::string& text) {
  TemporaryFolder folder;
  auto problems = problems_of({.file = folder.write("b.toml", text), .assignments = {}});
  for (auto& p : problems) {
    const std::string prefix = folder.path.string() + "/";
    if (p.starts_with(prefix)) p.erase(0, prefix.size());
  }
  return problems;
}

TEST(Config, TakesValuesOfEveryType) {
  TemporaryFolder folder;
  const Config c = load_config(
      {.file = folder.write("b.toml",
                            "[booth]\nid = \"lobby-2\"\n[stage]\nradius = 1.5\nheight = 2\n[dds]\nmulticast = false\npeers = [\"a\", \"10.0.0.2\"]\n"
                            "[cameras]\nsynthetic.count = 3\n"),
       .assignments = {}});
  EXPECT_EQ(c.booth.id, "lobby-2");
  EXPECT_EQ(c.stage.radius, 1.5);
  EXPECT_EQ(c.stage.height, 2.0) << "a whole number is a number";
  EXPECT_FALSE(c.dds.multicast);
  EXPECT_THAT(c.dds.peers, ElementsAre("a", "10.0.0.2"));
  EXPECT_EQ(c.cameras.synthetic.count, 3);
}

TEST(Config, LaterSourcesWin) {
  TemporaryFolder folder;
  const auto file = folder.write("b.toml", "[fit]\nthreads = 3\nseed = 5\n[booth]\nid = \"a\"\n");
  folder.write("b.toml.d/20-b.toml", "[fit]\nthreads = 5\n");
  folder.write("b.toml.d/10-a.toml", "[fit]\nthreads = 4\n[booth]\nid = \"b\"\n");
  folder.write("b.toml.d/30-not-toml.conf", "garbage");
  const Config c = load_config({.file = file, .assignments = {"booth.id=c", "stage.radius=1.25"}});
  EXPECT_EQ(c.fit.threads, 5);
  EXPECT_EQ(c.fit.seed, 5);
  EXPECT_EQ(c.booth.id, "c");
  EXPECT_EQ(c.stage.radius, 1.25);
}

TEST(Config, NamesFileLineKeyAndWhatIsAllowed) {
  EXPECT_THAT(problems_in("[stage]\n\nradius = 50\n"), ElementsAre("b.toml:3: stage.radius: 50 is out of range; allowed is a number from 0.5 to 5"));
  EXPECT_THAT(problems_in("[fit]\npreset = \"best\"\n"), ElementsAre("b.toml:2: fit.preset: \"best\" is not known; allowed is one of \"booth\", \"paper\""));
  EXPECT_THAT(problems_in("[fit]\nthreads = \"two\"\n"), ElementsAre("b.toml:2: fit.threads: has the wrong type; allowed is a whole number from 1 to 64"));
  EXPECT_THAT(problems_in("[fit]\nthreads = 2.0\n"), ElementsAre("b.toml:2: fit.threads: has the wrong type; allowed is a whole number from 1 to 64"));
  EXPECT_THAT(problems_in("stage = 3\n"), ElementsAre("b.toml:1: stage: must be a table"));
  EXPECT_THAT(problems_in("[stage]\nradius = nan\n"), ElementsAre(HasSubstr("stage.radius: nan is out of range")));
  EXPECT_THAT(problems_in("[booth]\nid = \"a b\"\n"), ElementsAre(HasSubstr("b.toml:2: booth.id: \"a b\" must be 1 to 32 letters")));
  EXPECT_THAT(problems_in("[dds]\npeers = [\"x\\\"/><evil\"]\n"), ElementsAre(HasSubstr("dds.peers"))) << "nothing of a value may become XML";
  EXPECT_THAT(problems_in("[dds]\nros2 = true\nros2_namespace = \"2nd floor\"\n"),
              ElementsAre(HasSubstr("b.toml:3: dds.ros2_namespace: \"2nd floor\" must be empty or like")));
  EXPECT_THAT(problems_in("[dds]\nros2 = true\nros2_namespace = \"/site/hall\"\n"), ElementsAre());
}

TEST(Config, SuggestsTheNearestKey) {
  EXPECT_THAT(problems_in("[fit]\ntreads = 2\n"), ElementsAre("b.toml:2: fit.treads: is not a key of boothd; did you mean fit.threads?"));
  EXPECT_THAT(problems_in("[booth]\nradius = 2.0\n"), ElementsAre("b.toml:2: booth.radius: is not a key of boothd; did you mean stage.radius?"));
  EXPECT_THAT(problems_in("qqqqqqqqqqqqqqqq = 2\n"), ElementsAre("b.toml:1: qqqqqqqqqqqqqqqq: is not a key of boothd"));
}

TEST(Config, ReportsAllProblemsOfAllSources) {
  TemporaryFolder folder;
  const auto file = folder.write("b.toml", "[fit]\nthreads = 0\nseed = -1\n");
  folder.write("b.toml.d/x.toml", "[dds]\ndomain = 233\n");
  EXPECT_EQ(problems_of({.file = file, .assignments = {"no-equals", "fit.threads=two", "nothing.such=1"}}).size(), 6u);
}

TEST(Config, SaysWhereTomlIsBroken) {
  EXPECT_THAT(problems_in("[fit]\nthreads = = 2\n"), ElementsAre(HasSubstr("b.toml:2: not TOML: ")));
  EXPECT_THAT(problems_of({.file = "/nonexistent/b.toml", .assignments = {}}), ElementsAre(HasSubstr("/nonexistent/b.toml: cannot be read: ")));
  // Reading it fails as on a bad sector: that is no file without keys, with which security would be off.
  EXPECT_THAT(problems_of({.file = "/proc/self/mem", .assignments = {}}), ElementsAre(HasSubstr("/proc/self/mem: cannot be read: ")));
}

TEST(Config, RefusesWhatThisBuildCannotDo) {
#if defined(BOOTHD_HAS_CUDA)
  GTEST_SKIP() << "skipped: this build has the CUDA back-end that the test wants absent";
#endif
  try {
    load_config({.file = {}, .assignments = {"fit.backend=cuda"}});
    FAIL() << "accepted";
  } catch (const ConfigError& e) {
    EXPECT_FALSE(e.only_device_absent);
    EXPECT_THAT(e.what(), HasSubstr("fit.backend: \"cuda\" is not in this build; allowed is one of \"auto\", \"cpu\""));
  }
}

TEST(Config, ChecksWhatBelongsTogether) {
  EXPECT_THAT(problems_of({.file = {}, .assignments = {"cameras.driver=recording"}}), ElementsAre(HasSubstr("cameras.recording.path: must name a recording")));
  EXPECT_THAT(problems_of({.file = {}, .assignments = {"cameras.synthetic.count=1"}}), ElementsAre(HasSubstr("cameras.minimum: is 2")));
  EXPECT_THAT(problems_of({.file = {}, .assignments = {"dds.security=on", "dds.domain=231"}}), ElementsAre(HasSubstr("dds.domain: is 231")));
}

TEST(Config, PrintsWhatItWouldReadAgain) {
  TemporaryFolder folder;
  const Config before =
      load_config({.file = {}, .assignments = {"stage.radius=1.7", "booth.id=x", "dds.peers=[\"a\",\"b\"]", "cameras.recording.path=a \"quoted\" \\ path"}});
  std::ostringstream text;
  print_config(before, text);
  const Config after = load_config({.file = folder.write("again.toml", text.str()), .assignments = {}});
  for (const ConfigKey& key : config_keys()) EXPECT_EQ(format_config_value(key, before), format_config_value(key, after)) << key.name;
}

TEST(Config, EveryDefaultIsAllowed) {
  TemporaryFolder folder;
  std::ostringstream text;
  print_config(Config{}, text);
  EXPECT_THAT(problems_of({.file = folder.write("d.toml", text.str()), .assignments = {}}), ElementsAre());
}

TEST(Config, TheReferencePageIsTheTable) {
#if defined(BOOTHD_HAS_CUDA)
  GTEST_SKIP() << "skipped: the page is that of a build without the CUDA back-end";
#endif
  std::ostringstream page;
  print_config_reference(page);
  EXPECT_EQ(tests::read_text(BOOTH_SOURCE_DIR "/docs/reference/configuration.md"), page.str())
      << "run: boothctl config reference > docs/reference/configuration.md";
}

TEST(Config, KnowsTheMotionsThatTheSimulationHas) {
  const ConfigKey* key = find_config_key("cameras.synthetic.motion");
  ASSERT_NE(key, nullptr);
  const auto names = drivers::motion_names();
  EXPECT_TRUE(std::equal(key->choices.begin(), key->choices.end(), names.begin(), names.end()));
}

TEST(Config, WhatTheTomlLibraryCannotStandIsRefusedWithItsPlace) {
  for (const auto& [text, place] : std::vector<std::pair<std::string, std::string>>{{"fit.th\xD0\x9D = 1\n", "x:1: not TOML: a character beyond ASCII"},
                                                                                    {"[fit]\nseed = 1\xC2\xA0\n", "x:2: not TOML: a character beyond ASCII"},
                                                                                    {"\n\n[#t]", "x:3: not TOML: a key is expected"}}) {
    std::vector<std::string> problems;
    load_settings({.file = {}, .assignments = {}, .files = ConfigSources::Files::none, .text = text, .text_name = "x"}, &problems);
    ASSERT_EQ(problems.size(), 1u) << text;
    EXPECT_THAT(problems[0], ::testing::StartsWith(place)) << text;
  }
  std::vector<std::string> problems;
  load_settings({.file = {}, .assignments = {"fit.seed=1\xC2\xA0"}, .files = ConfigSources::Files::none}, &problems);
  EXPECT_THAT(problems, ::testing::ElementsAre(::testing::HasSubstr("is not a value")));
}

}  // namespace
}  // namespace booth::daemon

// Mistakes in a configuration are named by file, line and key, with what is allowed; what is right is taken over.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>

#include "daemon/config/keys.hpp"
#include "daemon/config/load.hpp"
#include "drivers/synthetic/motions.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::daemon {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;
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

TEST(Config, KeysThatDoNotGoTogetherAreNamedWithTheirPlace) {
  EXPECT_THAT(problems_in("[cameras]\nminimum = 8\n"),
              ElementsAre("b.toml:2: cameras.minimum: is 8, but the simulated booth has only 4 cameras (cameras.synthetic.count)"));
  EXPECT_THAT(problems_in("[cameras]\nsynthetic.count = 1\n"), ElementsAre(StartsWith("b.toml:2: cameras.minimum: is 2, but"))) << "the one that was set";
  EXPECT_THAT(problems_in("cameras.driver = \"recording\"\n"), ElementsAre(StartsWith("b.toml:1: cameras.recording.path: must name a recording")));
  TemporaryFolder folder;
  const auto file = folder.write("b.toml", "[cameras]\nminimum = 3\n");
  const auto more = folder.write("b.toml.d/x.toml", "\n\n[cameras]\nsynthetic.count = 2\n");
  EXPECT_THAT(problems_of({.file = file, .assignments = {}}), ElementsAre(AllOf(StartsWith(file.string() + ":2: cameras.minimum: is 3"),
                                                                                HasSubstr("cameras.synthetic.count is set in " + more.string() + ":4"))));
  EXPECT_THAT(problems_of({.file = file, .assignments = {"cameras.minimum=2"}}), ElementsAre()) << "the last value counts";
  EXPECT_THAT(problems_of({.file = file, .assignments = {"cameras.minimum=4"}}), ElementsAre(StartsWith("--set cameras.minimum=4: cameras.minimum: is 4")));
}

TEST(Config, AMistakeInOneKeyHidesNoneOfOthersAndMakesNone) {
  EXPECT_THAT(problems_in("[cameras]\nminimum = 8\n[stage]\nradius = 50\n[dds]\nsecurity = \"on\"\ndomain = 231\n"),
              ElementsAre(StartsWith("b.toml:4: stage.radius"), StartsWith("b.toml:2: cameras.minimum"), StartsWith("b.toml:7: dds.domain")));
  // What may be meant otherwise is not complained about twice.
  for (const char* text : {"[cameras]\nminimum = 8\nsynthetic.count = \"8\"\n", "[cameras]\nminimum = 8\nsynthetic.cuont = 8\n",
                           "[cameras]\nminimum = 8\nsynthetic = 8\n", "[cameras]\nminimum = 8\ndriver = \"kinect3\"\n"})
    EXPECT_THAT(problems_in(text), ElementsAre(StartsWith("b.toml:3: "))) << text;
  TemporaryFolder folder;
  const auto file = folder.write("b.toml", "[cameras]\nsynthetic.count = 8\n= 2\n");
  EXPECT_THAT(problems_of({.file = file, .assignments = {"cameras.minimum=8"}}), ElementsAre(HasSubstr("b.toml:3: not TOML")));
  EXPECT_THAT(problems_of({.file = file, .assignments = {"cameras.minimum=8", "cameras.synthetic.count=2", "cameras.driver=synthetic"}}),
              ElementsAre(HasSubstr("b.toml:3: not TOML"), HasSubstr("cameras.minimum: is 8")))
      << "what comes later is certain";
}

TEST(Config, SaysWhereAKeyWasSet) {
  TemporaryFolder folder;
  const auto file = folder.write("b.toml", "[models]\ndirectory = \"/some/where\"\n[gpio]\nstart = \"3\"\n[cameras]\nminimum = 99\n");
  ::setenv("STATE_DIRECTORY", "/state", 1);
  std::vector<std::string> problems;
  const LoadedConfig read = load_settings({.file = file, .assignments = {"gpio.light=4", "privacy.seal_to=/a/key"}}, &problems);
  ::unsetenv("STATE_DIRECTORY");
  EXPECT_EQ(problems.size(), 1u);
  EXPECT_THAT(read.in_doubt, ElementsAre("cameras.minimum"));
  EXPECT_FALSE(read.places.contains("cameras.minimum")) << "its value is the default";
  const std::string name = file.string();
  EXPECT_EQ(read.placed({{"cameras.driver", "models.directory"}, "no models in /some/where"}), name + ":2: models.directory: no models in /some/where");
  EXPECT_EQ(read.placed({{"gpio.chip", "gpio.start"}, "gpio.start is set and gpio.chip is not"}), name + ":4: gpio.start is set and gpio.chip is not");
  EXPECT_EQ(read.placed({{"gpio.light"}, "is used"}), "--set gpio.light=4: gpio.light: is used");
  EXPECT_EQ(read.placed({{"privacy.seal_to"}, "/a/key: is no key"}), "--set privacy.seal_to=/a/key: privacy.seal_to: /a/key: is no key");
  EXPECT_EQ(read.placed({{"dds.security", "dds.self_issued"}, "/state/security/x is missing"}),
            "$STATE_DIRECTORY: dds.self_issued: /state/security/x is missing");
  EXPECT_EQ(read.placed({{"cameras.driver"}, "no cameras"}), "no cameras") << "nobody set it";
  EXPECT_EQ(read.placed({{}, "no cameras"}), "no cameras");
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

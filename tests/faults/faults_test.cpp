// The short form of toolchain/faults and toolchain/soak, and that what they watch with would notice.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/faults/booth.hpp"
#include "tests/faults/changed_files.hpp"
#include "tests/faults/faults.hpp"
#include "tests/faults/soak.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(Unit, HasTheFiguresOfTheServicesUnit) {
  const std::string unit = read_text(BOOTH_SOURCE_DIR "/systemd/boothd.service");
  const UnitRules rules;
  const auto seconds = [](std::chrono::milliseconds time) { return std::to_string(time.count() / 1000); };
  EXPECT_THAT(unit, HasSubstr("\nWatchdogSec=" + seconds(rules.watchdog) + "\n"));
  EXPECT_THAT(unit, HasSubstr("\nRestartSec=" + seconds(rules.restart) + "\n"));
  EXPECT_THAT(unit, HasSubstr("\nTimeoutAbortSec=" + seconds(rules.abort) + "\n"));
  EXPECT_THAT(unit, HasSubstr("\nRestartPreventExitStatus=64 78\n"));
  EXPECT_THAT(unit, HasSubstr("\nRestart=on-failure\n"));
}

UnitRules quick() { return {.watchdog = 200ms, .restart = 10ms, .abort = 200ms}; }
Unit shell(const TemporaryFolder& folder, const std::string& script) { return Unit({"/bin/sh", "-c", script}, folder.path, quick()); }

TEST(Unit, StartsAgainWhatFailsAndNotWhatEndedOrCannotBeMended) {
  for (const auto& [script, again] : std::vector<std::pair<std::string, bool>>{{"exit 1", true}, {"kill -9 $$", true}, {"exit 0", false}, {"exit 78", false}}) {
    const TemporaryFolder folder;
    Unit unit = shell(folder, script);
    unit.start();
    EXPECT_TRUE(eventually([&] { return again ? unit.state().starts >= 3 : unit.state().failed; }, 30s)) << script;
    EXPECT_TRUE(again || unit.state().starts == 1) << script;
  }
}

TEST(Unit, WatchesNothingThatWasToldToStop) {
  if (::system("command -v systemd-notify >/dev/null 2>&1") != 0) GTEST_SKIP() << "skipped: systemd-notify is not installed";
  const TemporaryFolder folder;
  Unit unit({"/bin/sh", "-c", "trap 'sleep 6; exit 0' TERM; systemd-notify --ready; while :; do sleep 0.1; done"}, folder.path, {.watchdog = 4s});
  unit.start();
  ASSERT_TRUE(unit.wait_ready(0, 60s));
  EXPECT_TRUE(unit.stop(60s)) << "wait status " << unit.state().last_status;
  EXPECT_EQ(unit.state().watchdogs, 0u);
}

TEST(Ledger, NoticesWhatWasLost) {
  const TemporaryFolder folder;
  const auto session = [&](const std::string& name, const std::string& json) {
    folder.write(name + "/session.json", json);
    return folder.path / name;
  };
  Ledger ledger;
  ledger.complete(session("a", "{}"));
  ledger.complete(session("b", "{}"));
  ledger.struck(session("c", R"({"result":"interrupted","frames":100})"), 120);
  EXPECT_THAT(ledger.check(), IsEmpty());
  EXPECT_EQ(ledger.interrupted(), 1u);
  folder.write("a/session.json", "{ }");
  std::filesystem::remove_all(folder.path / "b");
  folder.write("c/more", "");
  ledger.struck(session("d", R"({"result":"interrupted","frames":100})"), 200);
  ledger.struck(session("e", R"({"result":"running"})"), 0);
  ledger.struck(folder.path / "f", 0);
  EXPECT_EQ(ledger.check().size(), 6u);
}

TEST(ChangedFiles, ChangesOneByteOfEachRegionAndPutsItBack) {
  const TemporaryFolder folder;
  const auto file = folder.write("file", "0123456789");
  std::mt19937_64 random(1);
  std::vector<std::size_t> changed;
  with_each_region_changed(file, 5, random, [&](std::size_t at) {
    const std::string now = read_text(file);
    ASSERT_EQ(now.size(), 10u);
    for (std::size_t i = 0; i < 10; ++i) EXPECT_EQ(now[i] != "0123456789"[i], i == at);
    changed.push_back(at / 2);
  });
  EXPECT_EQ(changed, (std::vector<std::size_t>{0, 1, 2, 3, 4}));
  EXPECT_EQ(read_text(file), "0123456789");
  EXPECT_EQ(run_apart([] { return 7; }).status, 7);
  EXPECT_EQ(run_apart([] { return ::raise(SIGSEGV); }).status, -1);
  EXPECT_EQ(run_apart([]() -> int { throw 1; }).status, 99);
}

struct ShortForm : ::testing::TestWithParam<Fault> {};

/// Times are not judged: a test machine may be busy. What is lost, or hangs, or ends, is.
TEST_P(ShortForm, NothingAcknowledgedIsLost) {
  const TemporaryFolder folder;
  FaultPlan plan{.folder = folder.path, .times = GetParam().name == "kill" ? 3 : 1, .regions = 3};
  const FaultRow row = GetParam().run(plan);
  std::ostringstream said;
  print_text(said, row);
  if (!row.skipped.empty()) GTEST_SKIP() << "skipped: " << row.skipped;
  EXPECT_TRUE(as_expected(row, false)) << said.str();
  EXPECT_GE(row.times, 1);
  std::cout << said.str();
}
INSTANTIATE_TEST_SUITE_P(Faults, ShortForm, ::testing::ValuesIn(all_faults()), [](const auto& i) { return std::string(i.param.name); });

TEST(Soak, ShortForm) {
  const TemporaryFolder folder;
  const SoakVerdict verdict = soak({.folder = folder.path, .length = 24s, .window = 0.12, .session = 2, .idle = 0.5}, std::cout);
  print_text(std::cout, verdict);
  EXPECT_THAT(verdict.wrong, IsEmpty());
  EXPECT_GE(verdict.sessions, 3);
  EXPECT_GE(verdict.samples.size(), 3u);
  EXPECT_FALSE(verdict.faults.empty());
  EXPECT_THAT(to_markdown(verdict), HasSubstr("resident memory"));
  EXPECT_THAT(to_json(verdict), HasSubstr("\"samples\""));
}

}  // namespace
}  // namespace booth::tests

// boothctl fleet and watch: who is well, who is not, who is missing; tables, JSON, figures, exit statuses; hostile texts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "daemon/ctl/fleet_report.hpp"
#include "daemon/ctl/watch_network.hpp"
#include "tests/daemon/dds/peer.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/program.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {
namespace {

using daemon::fleet_json;
using daemon::fleet_rows;
using daemon::fleet_table;
using daemon::HeardBooth;
using daemon::unwell;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

HeardBooth well() {
  HeardBooth b;
  b.status_known = b.skeleton_known = b.present = true;
  b.status.state = 2;
  b.status.fps = 29.5f;
  b.status.frames = 100;
  b.status.residual = 0.008f;
  b.status.calibration_age_s = 3 * 86400;
  b.status.disk_free_bytes = 12'000'000'000;
  b.status.cameras = {{.name = "a", .state = "running"}, {.name = "b", .state = "lost"}};
  b.skeleton.person = 2;
  b.skeleton.state = 2;
  return b;
}

TEST(Fleet, SaysWhoIsWell) {
  std::map<std::string, HeardBooth> booths{{"lobby", well()}};
  const auto rows = fleet_rows(booths, {});
  EXPECT_EQ(unwell(rows), 0);
  const std::string table = fleet_table(rows);
  for (const char* text : {"lobby", "tracking", "1/2", "29.5", "8.0 mm", "3 d", "12.0 GB", "none", "1 booth, 0 unwell"}) EXPECT_THAT(table, HasSubstr(text));
  const json j = json::parse(fleet_json(rows));
  EXPECT_EQ(j["unwell"], 0);
  EXPECT_EQ(j["booths"][0]["well"], true);
  EXPECT_EQ(j["booths"][0]["calibration_age_s"], 3 * 86400);
}

TEST(Fleet, SaysWhoIsNotAndWhy) {
  std::map<std::string, HeardBooth> booths{{"faulty", well()}, {"gone", well()}, {"mute", well()}, {"twin", well()}, {"blind", well()}};
  booths["faulty"].status.faults = {{"cameras", "b is lost"}};
  booths["gone"].present = false;
  booths["mute"].status_known = false;
  booths["twin"].twice = true;
  booths["blind"].skeleton_known = false;
  const auto rows = fleet_rows(booths, {"faulty", "absent"});
  EXPECT_EQ(unwell(rows), 6);
  const std::string table = fleet_table(rows);
  for (const char* text : {"cameras: b is lost", "its sign of life has stopped", "no status", "two booths use this name", "no skeleton", "missing"})
    EXPECT_THAT(table, HasSubstr(text));
}

TEST(Fleet, HostileTextsAndNumbersAreHarmless) {
  std::map<std::string, HeardBooth> booths{{"e\033[2Jvil\xFF", well()}};
  HeardBooth& b = booths.begin()->second;
  b.status.faults = {{"x\a", "\033]0;title\a"}};
  b.status.fps = std::numeric_limits<float>::quiet_NaN();
  b.status.residual = std::numeric_limits<float>::infinity();
  b.status.calibration_age_s = -std::numeric_limits<double>::infinity();
  b.status.disk_free_bytes = std::numeric_limits<std::int64_t>::min();
  b.status.state = 200;
  for (auto& joint : b.skeleton.joints) joint = {1e308, -1e308, std::numeric_limits<double>::quiet_NaN()};
  const auto rows = fleet_rows(booths, {});
  const std::string table = fleet_table(rows), text = fleet_json(rows), figures = daemon::fleet_figures(booths, 80, 20);
  for (const std::string& s : {table, text, figures}) {
    EXPECT_THAT(s, Not(HasSubstr("\033")));
    EXPECT_THAT(s, Not(HasSubstr("\a")));
  }
  EXPECT_TRUE(json::parse(text)["booths"][0]["fps"].is_null());
}

TEST(Fleet, FiguresStandSideBySide) {
  std::map<std::string, HeardBooth> booths;
  for (const char* id : {"a", "b", "c", "d"}) booths[id] = well();
  for (auto& [id, b] : booths)
    for (std::size_t i = 0; i < b.skeleton.joints.size(); ++i) b.skeleton.joints[i] = {0, 0.02 * static_cast<double>(i), 0.07 * static_cast<double>(i)};
  const std::string out = daemon::fleet_figures(booths, 80, 20);
  EXPECT_EQ(std::count(out.begin(), out.end(), '\n'), 21);
  EXPECT_EQ(std::count(out.begin(), out.end(), '@'), 3) << "as many as fit";
  std::istringstream lines(out);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80u);
}

TEST(Fleet, TheProgramsSeeSimulatedBooths) {
  TemporaryFolder folder;
  const std::string domain = std::to_string(test_domain());
  Program booths("booth-simulated", {domain, "hall", "5", "lo", "1"}, folder.path / "booths");
  std::string said;
  const auto run = [&](std::vector<std::string> arguments) {
    for (const std::string& s : {"dds.domain=" + domain, std::string("dds.interface=lo"), std::string("dds.multicast=false")}) {
      arguments.push_back("--set");
      arguments.push_back(s);
    }
    Program program("boothctl", arguments, folder.path / "out");
    const int status = program.wait(std::chrono::seconds(90));
    said = program.output();
    return status;
  };
  const std::string everyone = "hall0,hall1,hall2,hall3,hall4";
  EXPECT_EQ(run({"fleet", "--expect", everyone, "--seconds", "60"}), 1) << "one has lost a camera";
  EXPECT_THAT(said, HasSubstr("5 booths, 1 unwell"));
  EXPECT_THAT(said, HasSubstr("the cable was pulled"));
  EXPECT_EQ(run({"watch", "hall3", "--seconds", "4"}), 0);
  EXPECT_THAT(said, HasSubstr("hall3            tracking   tracked"));
  EXPECT_THAT(said, Not(HasSubstr("hall2")));
  EXPECT_EQ(run({"fleet", "--expect", "hall9", "--seconds", "1", "--json"}), 1);
  EXPECT_THAT(said, HasSubstr("\"missing\""));
  EXPECT_EQ(run({"watch", "a b"}), 64);
}

}  // namespace
}  // namespace booth::tests

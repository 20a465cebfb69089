// The page of metrics, read by the rules of Prometheus' text format.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <regex>
#include <set>
#include <sstream>

#include "daemon/ctl/metrics_text.hpp"

namespace booth::daemon {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// Every line is HELP, TYPE or a sample; HELP and TYPE stand once, before the samples of their family, which stand together; no sample comes twice.
std::map<std::string, double> read_page(const std::string& page) {
  const std::regex help("# HELP ([a-zA-Z_:][a-zA-Z0-9_:]*) (.+)"), type("# TYPE ([a-zA-Z_:][a-zA-Z0-9_:]*) (gauge|counter|summary)");
  const std::regex sample(R"re(([a-zA-Z_:][a-zA-Z0-9_:]*)(\{[a-zA-Z_]\w*="(?:[^"\\]|\\[\\n"])*"(?:,[a-zA-Z_]\w*="(?:[^"\\]|\\[\\n"])*")*\})? (\S+))re");
  std::map<std::string, double> out;
  std::map<std::string, std::string> types;
  std::string family;
  EXPECT_TRUE(page.ends_with('\n'));
  std::istringstream lines(page);
  for (std::string line; std::getline(lines, line);) {
    std::smatch m;
    if (std::regex_match(line, m, help)) {
      family = m[1];
      EXPECT_FALSE(types.contains(family)) << line;
      types[family] = "";
    } else if (std::regex_match(line, m, type)) {
      EXPECT_EQ(m[1], family) << line;
      types[family] = m[2];
      if (m[2] == "counter") {
        EXPECT_TRUE(family.ends_with("_total")) << line;
      }
    } else if (std::regex_match(line, m, sample)) {
      std::string name = m[1];
      if (types[family] == "summary")
        for (const std::string suffix : {"_sum", "_count"})
          if (name == family + suffix) name = family;
      EXPECT_EQ(name, family) << line;
      EXPECT_NE(types[family], "") << line;
      EXPECT_TRUE(out.emplace(m[1].str() + m[2].str(), std::stod(m[3])).second) << "twice: " << line;
    } else {
      ADD_FAILURE() << "not of the format: " << line;
    }
  }
  return out;
}

const char* kStatus = R"({"ok":true,"state":"tracking","degraded":true,"paused":false,"alarm":"full disk","cameras_minimum":2,
  "session":"20261128T101500Z-7f","session_folder":"/var/lib/boothd/sessions/20261128T101500Z-7f",
  "cameras":[{"name":"front\"left\\","state":"running","fps":29.9,"delivered":9007199,"dropped":3,"corrupt":1,"restarts":0},
             {"name":"back\nright","state":"lost","fps":0,"delivered":5,"dropped":0,"corrupt":0,"restarts":4}],
  "groups":10,"frames":9,"fps":15.5,"latency_ms":{"count":4,"p50":50,"p95":80,"p99":90,"max":95,"mean":55},
  "stage_ms":{"cloud":{"count":2,"p50":1,"p95":2,"p99":3,"max":4,"mean":1.5}},"recorder":{"bytes_held":1024,"seconds_held":2.5}})";

TEST(Metrics, AreOfTheFormatAndInBaseUnits) {
  const auto page = read_page(metrics_text(StatusJson::parse(kStatus)));
  EXPECT_EQ(page.at("boothd_up"), 1);
  EXPECT_EQ(page.at("boothd_state{state=\"tracking\"}"), 1);
  EXPECT_EQ(page.at("boothd_state{state=\"idle\"}"), 0);
  EXPECT_EQ(page.at("boothd_degraded"), 1);
  EXPECT_EQ(page.at("boothd_alarm"), 1);
  EXPECT_EQ(page.at(R"(boothd_camera_frames_delivered_total{camera="front\"left\\"})"), 9007199);
  EXPECT_EQ(page.at(R"(boothd_camera_up{camera="back?right"})"), 0);
  EXPECT_DOUBLE_EQ(page.at("boothd_latency_seconds{quantile=\"0.99\"}"), 0.09);
  EXPECT_DOUBLE_EQ(page.at("boothd_latency_seconds_sum"), 0.22);
  EXPECT_EQ(page.at("boothd_latency_seconds_count"), 4);
  EXPECT_DOUBLE_EQ(page.at(R"(boothd_stage_seconds{stage="cloud",quantile="0.5"})"), 0.001);
  EXPECT_EQ(page.at("boothd_recorder_held_bytes"), 1024);
}

TEST(Metrics, CalibrationAndDiskAreLeftOutWhereNotKnown) {
  StatusJson status = StatusJson::parse(kStatus);
  status.update({{"calibration_age_s", 86400.5}, {"calibration_residual", 0.0042}, {"disk_free_bytes", 12'000'000'000}, {"disk_total_bytes", 64'000'000'000}});
  auto page = read_page(metrics_text(status));
  EXPECT_DOUBLE_EQ(page.at("boothd_calibration_age_seconds"), 86400.5);
  EXPECT_DOUBLE_EQ(page.at("boothd_calibration_residual_meters"), 0.0042);
  EXPECT_EQ(page.at("boothd_disk_free_bytes"), 12e9);
  EXPECT_EQ(page.at("boothd_disk_size_bytes"), 64e9);
  for (const char* key : {"calibration_age_s", "calibration_residual", "disk_free_bytes", "disk_total_bytes"}) status[key] = nullptr;
  page = read_page(metrics_text(status));
  for (const char* name : {"calibration_age_seconds", "calibration_residual_meters", "disk_free_bytes", "disk_size_bytes"})
    EXPECT_FALSE(page.contains(std::string("boothd_") + name)) << name;
}

TEST(Metrics, NameNoSession) { EXPECT_THAT(metrics_text(StatusJson::parse(kStatus)), Not(HasSubstr("20261128T"))); }

TEST(Metrics, SayThatBoothdDoesNotAnswer) {
  for (const char* answer : {"null", "[]", "7", R"({"ok":false,"error":"x"})", R"({"ok":"yes"})"})
    EXPECT_EQ(read_page(metrics_text(StatusJson::parse(answer))), (std::map<std::string, double>{{"boothd_up", 0}})) << answer;
}

TEST(Metrics, ReadAStatusThatIsAllWrong) {
  const auto page = read_page(metrics_text(StatusJson::parse(
      R"({"ok":true,"state":7,"cameras":[null,3,{"name":[],"fps":"fast"},{"name":"a\u0001"},{"name":"a\u0002","delivered":-1e300},{"name":"a?"}],"latency_ms":[1],"stage_ms":[[]],"panel":{"problems":"all"},"recorder":null})")));
  EXPECT_EQ(page.at("boothd_up"), 1);
}

}  // namespace
}  // namespace booth::daemon

// The booth's own topics, heard and commanded by another vendor's DDS with types made from the IDL that we hand out: every member what it must be.
#include <gtest/gtest.h>

#include <atomic>

#include "daemon/dds/dds_link.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/dds/peer.hpp"
#include "tests/daemon/dds/ros2/expectations.hpp"
#include "tests/daemon/dds/ros2/fastdds_said.hpp"
#include "tests/daemon/support/fake_booth.hpp"
#include "tests/daemon/support/program.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;

daemon::FrameRecord full_frame() {
  daemon::FrameRecord out = posed_frame(41);
  out.session_state = 3;
  out.sex = daemon::RecordSex::women;
  out.shape_count = 7;
  for (std::size_t i = 0; i < 7; ++i) out.beta[i] = 0.125 * static_cast<double>(i) - 1;
  for (std::size_t j = 0; j < daemon::kRecordJoints; ++j) {
    for (std::size_t k = 0; k < 6; ++k) out.covariance[j][k] = 1e-4f * static_cast<float>(10 * j + k);
    out.seen[j] = j % 3 == 0;
  }
  out.residual = 0.0075f;
  out.coverage = 0.625f;
  out.cameras = 3;
  out.others = 2;
  out.groups_dropped = 12345678901;
  return out;
}

daemon::BodySample full_body() {
  daemon::BodySample out;
  out.session = "20260101T000000Z-1";
  out.model_version = "women 3";
  out.sex = daemon::RecordSex::women;
  out.beta = {1, -2, 0.5};
  for (std::size_t j = 0; j < daemon::kRecordJoints; ++j) out.bone_lengths[j] = 0.01 * static_cast<double>(j);
  out.measurements = {{.name = "stature", .unit = "m", .value = 1.75, .deviation = 0.01}, {.name = "volume", .unit = "m^3", .value = 0.07, .deviation = -1}};
  return out;
}

daemon::StatusSample full_status() {
  daemon::StatusSample out;
  out.state = 2;
  out.degraded = true;
  out.latched = true;
  out.software = "boothd 1";
  out.session = "s";
  out.alarm = "caf\xC3\xA9";
  out.faults = {{"cameras", "one is lost"}, {"disk", ""}};
  out.cameras = {{.name = "front-left", .state = "running", .fps = 29.5f, .delivered = 10'000'000'000, .dropped = 3, .restarts = 1},
                 {.name = "b", .state = "lost"}};
  out.frames = 9;
  out.groups_dropped = 1;
  out.fps = 29.25f;
  out.latency_p50_ms = 40.5f;
  out.latency_p99_ms = 60.25f;
  out.residual = 0.5f;
  out.calibration_age_s = 86400;
  out.calibration_residual = 0.002;
  out.disk_free_bytes = -1;
  out.disk_total_bytes = 500'000'000'000;
  return out;
}

void expect_skeleton(const Json& s, const daemon::FrameRecord& frame) {
  EXPECT_EQ(s.at("booth"), "hall");
  EXPECT_EQ(s.at("version"), 1);
  EXPECT_GT(s.at("serial_number"), 0);
  EXPECT_EQ(s.at("frame"), frame.sequence);
  EXPECT_EQ(s.at("capture_utc_ns"), frame.captured_utc_ns);
  EXPECT_EQ(s.at("capture_monotonic_ns"), frame.captured_ns);
  EXPECT_GT(s.at("publish_utc_ns"), 1'700'000'000'000'000'000);
  EXPECT_GT(s.at("publish_monotonic_ns"), 0);
  EXPECT_EQ(s.at("state"), 3);
  EXPECT_EQ(s.at("person"), 2);
  EXPECT_EQ(s.at("sex"), 1);
  EXPECT_EQ(s.at("q"), Json(frame.q));
  EXPECT_EQ(s.at("beta"), Json(std::vector<double>(frame.beta.begin(), frame.beta.begin() + frame.shape_count)));
  ASSERT_EQ(s.at("joints").size(), daemon::kRecordJoints);
  for (std::size_t j = 0; j < daemon::kRecordJoints; ++j) {
    const Json& joint = s.at("joints")[j];
    EXPECT_EQ(joint.at("position"), Json(frame.joints[j])) << j;
    EXPECT_EQ(joint.at("orientation"), Json(std::vector<double>(frame.rotation[j].begin(), frame.rotation[j].end()))) << j;
    EXPECT_EQ(joint.at("covariance"), Json(frame.covariance[j])) << j;
    EXPECT_EQ(joint.at("seen"), frame.seen[j] != 0) << j;
  }
  EXPECT_EQ(s.at("residual"), Json(frame.residual));
  EXPECT_EQ(s.at("coverage"), Json(frame.coverage));
  EXPECT_EQ(s.at("cameras"), 3);
  EXPECT_EQ(s.at("others"), 2);
  EXPECT_EQ(s.at("groups_dropped"), frame.groups_dropped);
}

void expect_body(const Json& heard, const daemon::BodySample& body) {
  EXPECT_GT(heard.at("utc_ns"), 1'700'000'000'000'000'000);
  Json expected{{"booth", "hall"},
                {"version", 1},
                {"session", body.session},
                {"utc_ns", heard.at("utc_ns")},
                {"sex", 1},
                {"beta", body.beta},
                {"model_version", body.model_version},
                {"bone_lengths", body.bone_lengths}};
  for (const auto& m : body.measurements)
    expected["measurements"].push_back({{"name", m.name}, {"unit", m.unit}, {"value", m.value}, {"deviation", m.deviation}});
  EXPECT_EQ(heard, expected);
}

void expect_status(const Json& heard, const daemon::StatusSample& s) {
  EXPECT_GT(heard.at("utc_ns"), 1'700'000'000'000'000'000);
  EXPECT_GT(heard.at("monotonic_ns"), 0);
  Json expected{{"booth", "hall"},
                {"version", 1},
                {"software", s.software},
                {"utc_ns", heard.at("utc_ns")},
                {"monotonic_ns", heard.at("monotonic_ns")},
                {"state", s.state},
                {"degraded", true},
                {"paused", false},
                {"emergency_latched", true},
                {"session", s.session},
                {"alarm", s.alarm},
                {"frames", s.frames},
                {"groups_dropped", s.groups_dropped},
                {"fps", s.fps},
                {"latency_p50_ms", s.latency_p50_ms},
                {"latency_p99_ms", s.latency_p99_ms},
                {"residual", s.residual},
                {"calibration_age_s", s.calibration_age_s},
                {"calibration_residual", s.calibration_residual},
                {"disk_free_bytes", s.disk_free_bytes},
                {"disk_total_bytes", s.disk_total_bytes}};
  for (const auto& f : s.faults) expected["faults"].push_back({{"source", f.first}, {"text", f.second}});
  for (const auto& c : s.cameras)
    expected["cameras"].push_back(
        {{"name", c.name}, {"state", c.state}, {"fps", c.fps}, {"delivered", c.delivered}, {"dropped", c.dropped}, {"restarts", c.restarts}});
  EXPECT_EQ(heard, expected);
}

TEST(BoothFastDds, HearsEveryMemberAndCommands) {
  if (!fastdds_is_there()) GTEST_SKIP() << kNoFastDds;
  drivers::SystemClock clock;
  std::atomic<int> starts{0};
  daemon::DdsLink link(loopback("hall"), clock, [&](daemon::DdsCommand c) {
    starts += c == daemon::DdsCommand::start;
    return daemon::DdsAnswer{.accepted = true, .state = 1};
  });
  link.publish(full_body());
  link.publish(full_status());
  TemporaryFolder folder;
  Program reader("booth-fastdds-reader", {std::to_string(test_domain()), "booth", "hall"}, folder.path / "heard");
  // Skeletons and events are said until they are heard; body and status are there for who comes late; the command is answered.
  ASSERT_TRUE(eventually(
      [&] {
        link.publish(full_frame());
        link.publish_event("trigger", "test", "somebody pressed");
        std::this_thread::sleep_for(100ms);
        return read_lines(reader.output()).samples.size() == 5;
      },
      60s))
      << reader.output();
  const Said said = read_lines(reader.output());
  expect_skeleton(said.samples.at("booth/skeleton"), full_frame());
  expect_body(said.samples.at("booth/body"), full_body());
  expect_status(said.samples.at("booth/status"), full_status());
  const Json event = said.samples.at("booth/event");
  EXPECT_EQ(event, Json({{"booth", "hall"},
                         {"version", 1},
                         {"serial_number", event.at("serial_number")},
                         {"utc_ns", event.at("utc_ns")},
                         {"kind", "trigger"},
                         {"source", "test"},
                         {"text", "somebody pressed"}}));
  const Json reply = said.samples.at("booth/reply");
  EXPECT_EQ(reply, Json({{"booth", "hall"},
                         {"version", 1},
                         {"sender", "another vendor"},
                         {"id", 77},
                         {"accepted", true},
                         {"repeated", reply.at("repeated")},  // the first answer may have come before the reader was known
                         {"state", 1},
                         {"text", ""}}));
  EXPECT_EQ(starts, 1) << "once, however often it was said";
}

}  // namespace
}  // namespace booth::tests

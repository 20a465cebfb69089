// What goes out on DDS comes in again: through the loopback interface, without multicast, as in a sandbox.
#include <dds/dds.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <thread>

#include "daemon/dds/bounded_text.hpp"
#include "daemon/dds/dds_link.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/dds/peer.hpp"
#include "tests/daemon/support/fake_booth.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

using tests::has_reader;
using tests::has_writer;
using tests::take;

const DdsSettings kSettings = tests::loopback("test-booth");

struct Peer : tests::Peer {
  explicit Peer(const char* partition = "test-booth") : tests::Peer(partition) {}
  dds_entity_t command_writer() { return writer(booth_msg_Command_desc, "booth/command"); }
};

struct DdsTest : ::testing::Test {
  drivers::SystemClock clock;
  std::atomic<int> starts{0}, stops{0};
  DdsLink link{kSettings, clock, [this](DdsCommand c) {
                 ++(c == DdsCommand::start ? starts : stops);
                 return DdsAnswer{c == DdsCommand::start, 1, c == DdsCommand::start ? "" : "no session is running"};
               }};
};

TEST_F(DdsTest, ASkeletonArrivesWhole) {
  Peer peer;
  const dds_entity_t reader = peer.reader(booth_msg_Skeleton_desc, "booth/skeleton", false, false);
  FrameRecord frame;
  frame.sequence = 41;
  frame.captured_ns = 123;
  frame.captured_utc_ns = 456;
  frame.session_state = 2;
  frame.person = PersonState::tracked;
  frame.sex = RecordSex::women;
  frame.shape_count = 5;
  frame.groups_dropped = 7;
  frame.cameras = 4;
  for (std::size_t i = 0; i < 36; ++i) frame.q[i] = 0.5 * static_cast<double>(i);
  for (std::size_t i = 0; i < 5; ++i) frame.beta[i] = -static_cast<double>(i);
  frame.joints[23] = {1, 2, 3};
  frame.rotation[23] = {0, 0, 1, 0};
  frame.covariance[23] = {1, 2, 3, 4, 5, 6};
  frame.seen[23] = 1;
  frame.residual = 0.25f;
  // Best effort: whoever has not been found yet hears nothing, so it is said until it is heard.
  bool heard = false;
  for (int i = 0; i < 100 && !heard; ++i) {
    link.publish(frame);
    heard = take<booth_msg_Skeleton>(
        reader,
        [&](const booth_msg_Skeleton& s) {
          EXPECT_STREQ(s.booth, "test-booth");
          EXPECT_EQ(s.frame, 41u);
          EXPECT_EQ(s.capture_monotonic_ns, 123);
          EXPECT_EQ(s.capture_utc_ns, 456);
          EXPECT_GT(s.publish_utc_ns, 1'700'000'000'000'000'000);
          EXPECT_EQ(s.state, booth_msg_STATE_TRACKING);
          EXPECT_EQ(s.person, booth_msg_PERSON_TRACKED);
          EXPECT_EQ(s.sex, booth_msg_SEX_WOMEN);
          EXPECT_EQ(s.q[35], 17.5);
          ASSERT_EQ(s.beta._length, 5u);
          EXPECT_EQ(s.beta._buffer[4], -4);
          EXPECT_EQ(s.joints[23].position[2], 3);
          EXPECT_EQ(s.joints[23].orientation[2], 1);
          EXPECT_EQ(s.joints[23].covariance[5], 6);
          EXPECT_TRUE(s.joints[23].seen);
          EXPECT_FALSE(s.joints[0].seen);
          EXPECT_EQ(s.residual, 0.25f);
          EXPECT_EQ(s.cameras, 4u);
          EXPECT_EQ(s.groups_dropped, 7u);
        },
        50ms);
  }
  EXPECT_TRUE(heard);
  EXPECT_EQ(link.failures(), 0u) << link.last_failure();
}

TEST(BoundedText, IsCutBetweenCharacters) {
  const auto cut = [](const std::string& text) {
    char to[6];
    std::fill(std::begin(to), std::end(to), 'x');
    set_text(to, text);
    EXPECT_EQ(to[5], '\0');
    return std::string(to);
  };
  EXPECT_EQ(cut("lobby"), "lobby");
  EXPECT_EQ(cut("lobby2"), "lobby");
  EXPECT_EQ(cut("abcd\xc3\xa9"), "abcd") << "half of an e with an accent is refused together with its sample";
  EXPECT_EQ(cut("abc\xc3\xa9z"), "abc\xc3\xa9");
  EXPECT_EQ(cut("ab\xf0\x9f\x9a\xaaz"), "ab");
  EXPECT_EQ(cut("\x80\x80\x80\x80\x80\x80"), "\x80\x80\x80\x80\x80") << "what is no UTF-8 is cut anywhere";
}

TEST_F(DdsTest, IdleSamplesHoldNobody) {
  Peer peer;
  const dds_entity_t reader = peer.reader(booth_msg_Skeleton_desc, "booth/skeleton", false, false);
  FrameRecord frame;
  frame.person = PersonState::tracked;
  frame.shape_count = 9;
  frame.q[0] = 5;
  link.publish(frame);
  bool idle = false;
  for (int i = 0; i < 100 && !idle; ++i) {
    link.publish_idle(0);
    take<booth_msg_Skeleton>(
        reader,
        [&](const booth_msg_Skeleton& s) {
          if (s.state != booth_msg_STATE_IDLE || s.beta._length != 0) return;
          idle = true;
          EXPECT_EQ(s.person, booth_msg_PERSON_LOST);
          EXPECT_EQ(s.q[0], 0) << "the last person's pose is nobody's business";
          EXPECT_STREQ(s.booth, "test-booth");
        },
        50ms);
  }
  EXPECT_TRUE(idle);
}

TEST_F(DdsTest, BodyAndStatusReachLateJoiners) {
  BodySample body;
  body.session = "s1";
  body.model_version = "men 1";
  body.beta = {1, 2, 3};
  body.bone_lengths[5] = 0.4;
  body.measurements = {{.name = "stature", .unit = "m", .value = 1.8, .deviation = 0.01}};
  link.publish(body);
  StatusSample status;
  status.state = 3;
  status.alarm = std::string(500, 'a');
  for (int i = 0; i < 20; ++i) status.faults.emplace_back("disk", "fault " + std::to_string(i));
  status.software = "boothd 1";
  status.calibration_age_s = 5;
  status.disk_free_bytes = 7;
  status.cameras.push_back({.name = "front-left", .state = "running", .fps = 30, .delivered = 9, .dropped = 1, .restarts = 2});
  link.publish(status);

  Peer late;
  EXPECT_TRUE(take<booth_msg_Body>(late.reader(booth_msg_Body_desc, "booth/body", true, true), [](const booth_msg_Body& b) {
    EXPECT_STREQ(b.session, "s1");
    ASSERT_EQ(b.beta._length, 3u);
    EXPECT_EQ(b.beta._buffer[2], 3);
    EXPECT_EQ(b.bone_lengths[5], 0.4);
    ASSERT_EQ(b.measurements._length, 1u);
    EXPECT_STREQ(b.measurements._buffer[0].name, "stature");
    EXPECT_STREQ(b.measurements._buffer[0].unit, "m");
    EXPECT_EQ(b.measurements._buffer[0].value, 1.8);
    EXPECT_EQ(b.measurements._buffer[0].deviation, 0.01);
    EXPECT_EQ(b.version, booth_msg_VERSION);
  }));
  EXPECT_TRUE(take<booth_msg_Status>(late.reader(booth_msg_Status_desc, "booth/status", true, true), [](const booth_msg_Status& s) {
    EXPECT_EQ(s.state, booth_msg_STATE_SEARCHING);
    EXPECT_EQ(std::string(s.alarm), std::string(160, 'a')) << "cut at the bound";
    ASSERT_EQ(s.faults._length, 8u) << "the first that fit";
    EXPECT_STREQ(s.faults._buffer[7].text, "fault 7");
    EXPECT_STREQ(s.software, "boothd 1");
    EXPECT_EQ(s.calibration_age_s, 5);
    EXPECT_EQ(s.calibration_residual, -1);
    EXPECT_EQ(s.disk_free_bytes, 7);
    ASSERT_EQ(s.cameras._length, 1u);
    EXPECT_STREQ(s.cameras._buffer[0].name, "front-left");
    EXPECT_EQ(s.cameras._buffer[0].restarts, 2u);
  }));
}

TEST_F(DdsTest, ATextThatIsTooLongEndsWithAWholeCharacter) {
  struct Case {
    std::string text, heard;
  };
  const auto repeat = [](int times, const std::string& what) {
    std::string out;
    for (int i = 0; i < times; ++i) out += what;
    return out;
  };
  const std::string two = "\xC3\xA4", three = "\xE2\x82\xAC", four = "\xF0\x9F\x99\x82";
  for (const Case& one :
       {Case{repeat(90, two), repeat(80, two)}, Case{"a" + repeat(90, two), "a" + repeat(79, two)}, Case{repeat(60, three), repeat(53, three)},
        Case{repeat(50, four), repeat(40, four)}, Case{"abc" + repeat(50, four), "abc" + repeat(39, four)}, Case{repeat(80, two), repeat(80, two)},
        Case{std::string(200, '\x80'), std::string(160, '\x80')}}) {
    StatusSample status;
    status.alarm = one.text;
    link.publish(status);
    Peer late;
    EXPECT_TRUE(take<booth_msg_Status>(late.reader(booth_msg_Status_desc, "booth/status", true, true),
                                       [&](const booth_msg_Status& s) { EXPECT_EQ(std::string(s.alarm), one.heard); }));
  }
}

TEST_F(DdsTest, CommandsAreAnsweredWithTheirId) {
  Peer peer;
  const dds_entity_t replies = peer.reader(booth_msg_Reply_desc, "booth/reply", true, false);
  const dds_entity_t writer = peer.command_writer();
  // Volatile writers do not repeat for whom they have not met: wait for both directions.
  ASSERT_TRUE(tests::eventually([&] { return has_reader(writer) && has_writer(replies); }, 60s));
  const auto start = tests::command("test-booth", "console", 77, booth_msg_COMMAND_START);
  for (int i = 0; i < 2; ++i) {
    ASSERT_EQ(dds_write(writer, &start), 0);
    EXPECT_TRUE(take<booth_msg_Reply>(replies, [&](const booth_msg_Reply& r) {
      EXPECT_EQ(r.id, 77u);
      EXPECT_STREQ(r.sender, "console");
      EXPECT_TRUE(r.accepted);
      EXPECT_EQ(r.repeated, i == 1);
      EXPECT_EQ(r.state, booth_msg_STATE_ESTIMATING);
    }));
  }
  const auto stop = tests::command("test-booth", "console", 78, booth_msg_COMMAND_STOP);
  ASSERT_EQ(dds_write(writer, &stop), 0);
  EXPECT_TRUE(take<booth_msg_Reply>(replies, [](const booth_msg_Reply& r) {
    EXPECT_EQ(r.id, 78u);
    EXPECT_FALSE(r.accepted);
    EXPECT_STREQ(r.text, "no session is running");
  }));
  EXPECT_EQ(starts, 1) << "the second was the same command";
  EXPECT_EQ(stops, 1);
}

TEST_F(DdsTest, AnotherBoothsCommandsAreNotHeard) {
  Peer peer, other("other-booth");
  const dds_entity_t writer = peer.command_writer(), elsewhere = other.command_writer();
  ASSERT_TRUE(tests::eventually([&] { return has_reader(writer); }, 60s));
  const auto theirs = tests::command("other-booth", "console", 1, booth_msg_COMMAND_START);
  ASSERT_EQ(dds_write(elsewhere, &theirs), 0) << "in the other partition";
  ASSERT_EQ(dds_write(writer, &theirs), 0) << "in ours, under the other's name";
  const auto ours = tests::command("test-booth", "console", 2, booth_msg_COMMAND_STOP);
  ASSERT_EQ(dds_write(writer, &ours), 0);
  ASSERT_TRUE(tests::eventually([&] { return stops == 1; }, 60s));
  EXPECT_EQ(starts, 0);
}

TEST(DdsConfiguration, SaysWhatTheKeysSay) {
  const std::string xml = dds_configuration({.booth = "b", .domain = 0, .interface = "eth1", .multicast = false, .peers = {"10.1.1.1"}});
  EXPECT_THAT(xml, HasSubstr("<NetworkInterface name=\"eth1\"/>"));
  EXPECT_THAT(xml, HasSubstr("<AllowMulticast>false</AllowMulticast>"));
  EXPECT_THAT(xml, HasSubstr("<Peer Address=\"localhost\"/><Peer Address=\"10.1.1.1\"/>"));
  EXPECT_THAT(dds_configuration({.booth = "b", .domain = 0, .interface = "192.168.0.7", .multicast = true, .peers = {}}), HasSubstr("address=\"192.168.0.7\""));
  EXPECT_THAT(dds_configuration({}), ::testing::Not(HasSubstr("Peer")));
}

}  // namespace
}  // namespace booth::daemon

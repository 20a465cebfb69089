// What a node of ROS 2 hears of a booth, in life and in detail; read with our own vendor's library.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <optional>
#include <vector>

#include "daemon/dds/dds_link.hpp"
#include "daemon/dds/ros2/ros2_topics.hpp"
#include "drivers/clock/manual_clock.hpp"
#include "drivers/clock/system_clock.hpp"
#include "tests/daemon/dds/ros2/expectations.hpp"
#include "tests/daemon/dds/ros2/ros_node.hpp"
#include "tests/daemon/support/fake_booth.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;
using daemon::DdsLink;
using daemon::FrameRecord;
using daemon::Ros2Topic;

daemon::DdsAnswer no(daemon::DdsCommand) { return {}; }

daemon::DdsSettings with_ros2(const std::string& booth, const std::string& name_space = "") {
  daemon::DdsSettings out = loopback(booth);
  out.ros2 = daemon::Ros2Settings{.name_space = name_space, .cameras = two_cameras()};
  return out;
}

struct Ros2Mirror : ::testing::Test {
  drivers::SystemClock clock;
};

TEST_F(Ros2Mirror, EveryFieldArrives) {
  DdsLink link(with_ros2("front-hall"), clock, no);
  Node node("front-hall");
  node.meet(link);
  const FrameRecord frame = posed_frame();
  const fit::Cloud cloud = numbered_cloud(1500);
  link.offer_cloud(cloud, frame.captured_ns);
  link.publish(frame);
  const auto tracked = node.hear<hri_msgs_msg_dds__IdsList_>(Ros2Topic::tracked);
  const auto states = node.hear<sensor_msgs_msg_dds__JointState_>(Ros2Topic::joint_states);
  const auto tf = node.hear<tf2_msgs_msg_dds__TFMessage_>(Ros2Topic::tf), tf_static = node.hear<tf2_msgs_msg_dds__TFMessage_>(Ros2Topic::tf_static);
  const auto joints = node.hear<geometry_msgs_msg_dds__PoseArray_>(Ros2Topic::joints);
  const auto points = node.hear<sensor_msgs_msg_dds__PointCloud2_>(Ros2Topic::cloud);
  ASSERT_TRUE(tracked && states && tf && tf_static && joints && points);
  expect_tracked(*tracked, "front_hall", true, frame.captured_utc_ns);
  expect_joint_states(*states, "front_hall", frame);
  expect_tf(*tf, "front_hall", frame);
  expect_tf_static(*tf_static, "front_hall");
  expect_joints(*joints, "front_hall", frame);
  expect_cloud(*points, "front_hall", frame, 1500, 1500);
  EXPECT_EQ(link.failures(), 0u) << link.last_failure();
}

TEST_F(Ros2Mirror, WhoComesLateIsToldWhereTheCamerasAre) {
  DdsLink link(with_ros2("b"), clock, no);
  std::this_thread::sleep_for(200ms);
  Node late("b");
  const auto heard = late.hear<tf2_msgs_msg_dds__TFMessage_>(Ros2Topic::tf_static, 60s);
  ASSERT_TRUE(heard);
  expect_tf_static(*heard, "b");
}

TEST_F(Ros2Mirror, NobodyIsSaidAndNothingElse) {
  DdsLink link(with_ros2("b"), clock, no);
  Node node("b");
  ASSERT_TRUE(node.matched());
  const auto ids = [&](auto say, std::size_t wanted) {
    // Said on change, and again each second for those who come late.
    return eventually(
        [&] {
          say();
          const auto heard = node.hear<hri_msgs_msg_dds__IdsList_>(Ros2Topic::tracked, 20ms);
          return heard && heard->at("ids").size() == wanted;
        },
        30s);
  };
  EXPECT_TRUE(ids([&] { link.publish_idle(0); }, 0));
  EXPECT_TRUE(ids([&] { link.publish(posed_frame()); }, 1));
  FrameRecord lost = posed_frame();
  lost.person = daemon::PersonState::lost;
  while (node.hear<tf2_msgs_msg_dds__TFMessage_>(Ros2Topic::tf, 200ms)) {
  }
  EXPECT_TRUE(ids([&] { link.publish(lost); }, 0));
  FrameRecord broken = posed_frame();
  broken.joints[4][2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(ids([&] { link.publish(posed_frame()); }, 1));
  while (node.hear<tf2_msgs_msg_dds__TFMessage_>(Ros2Topic::tf, 200ms)) {
  }
  EXPECT_TRUE(ids([&] { link.publish(broken); }, 0)) << "tf2 refuses what is no number; nobody is there, then";
  EXPECT_FALSE(node.hear<tf2_msgs_msg_dds__TFMessage_>(Ros2Topic::tf, 100ms));
}

TEST_F(Ros2Mirror, WhoIsThereIsSaidEachSecond) {
  drivers::ManualClock stands;
  DdsLink link(with_ros2("b"), stands, no);
  Node node("b");
  node.meet(link);
  const auto said = [&](std::chrono::milliseconds limit) { return node.hear<hri_msgs_msg_dds__IdsList_>(Ros2Topic::tracked, limit).has_value(); };
  const auto live = [&] {
    for (int i = 0; i < 20; ++i, std::this_thread::sleep_for(5ms)) link.publish_idle(0);
  };
  live();
  EXPECT_FALSE(said(200ms)) << "not with every sign of life";
  stands.advance(999ms);
  live();
  EXPECT_FALSE(said(200ms));
  stands.advance(1ms);
  live();
  EXPECT_TRUE(said(20s)) << "for those who come late";
  EXPECT_FALSE(said(200ms)) << "once";
}

TEST_F(Ros2Mirror, CloudsAreFewAndSmall) {
  DdsLink link(with_ros2("b"), clock, no);
  Node node("b");
  node.meet(link);
  const fit::Cloud cloud = numbered_cloud(20'000);
  constexpr int kFrames = 61;  // two seconds at 30 frames/s, said faster
  std::map<std::int64_t, FrameRecord> frames;
  std::vector<FrameRecord> told;
  const auto collect = [&](std::chrono::milliseconds limit) {
    while (const auto heard = node.hear<sensor_msgs_msg_dds__PointCloud2_>(Ros2Topic::cloud, limit)) {
      const auto& stamp = heard->at("header");
      const auto frame = frames.find(stamp.at("sec").get<std::int64_t>() * 1'000'000'000 + stamp.at("nanosec").get<std::int64_t>());
      ASSERT_NE(frame, frames.end());
      expect_cloud(*heard, "b", frame->second, 20'000, 4096);
      told.push_back(frame->second);
    }
  };
  for (int n = 1; n <= kFrames; ++n) {
    FrameRecord frame = posed_frame(static_cast<std::uint64_t>(n));
    // Instants of real images are never quite evenly spaced.
    frame.captured_ns += n % 3 * 1'000'000;
    frames[frame.captured_utc_ns] = frame;
    link.offer_cloud(cloud, frame.captured_ns);
    link.publish(frame);
    // When its joints are there, the mirror has taken the frame and what belongs to it: only the rate decides which clouds are sent.
    ASSERT_TRUE(node.hear<geometry_msgs_msg_dds__PoseArray_>(Ros2Topic::joints));
    collect(0ms);
  }
  collect(1s);
  EXPECT_GE(told.size(), 9u);
  EXPECT_LE(told.size(), 11u) << "five a second";
  for (std::size_t i = 1; i < told.size(); ++i) EXPECT_GT(told[i].captured_ns - told[i - 1].captured_ns, 90'000'000);
  // A recording that is played again begins in the past.
  FrameRecord again = posed_frame(1);
  bool heard = false;
  for (int i = 0; i < 20 && !heard; ++i) {
    again.captured_ns += 33'000'000;
    link.offer_cloud(cloud, again.captured_ns);
    link.publish(again);
    heard = node.hear<sensor_msgs_msg_dds__PointCloud2_>(Ros2Topic::cloud, 500ms).has_value();
  }
  EXPECT_TRUE(heard);
}

TEST_F(Ros2Mirror, ACloudGoesWithItsFrameOrNotAtAll) {
  DdsLink link(with_ros2("b"), clock, no);
  Node node("b");
  node.meet(link);
  FrameRecord lost = posed_frame(1);
  lost.person = daemon::PersonState::lost;
  link.offer_cloud(numbered_cloud(10), lost.captured_ns);
  link.publish(lost);
  link.publish(posed_frame(2));  // without a cloud
  EXPECT_FALSE(node.hear<sensor_msgs_msg_dds__PointCloud2_>(Ros2Topic::cloud, 300ms));
  const FrameRecord frame = posed_frame(3);
  link.offer_cloud(numbered_cloud(0), frame.captured_ns);
  link.publish(frame);
  const auto empty = node.hear<sensor_msgs_msg_dds__PointCloud2_>(Ros2Topic::cloud);
  ASSERT_TRUE(empty);
  EXPECT_EQ(empty->at("width"), 0);
  EXPECT_TRUE(empty->at("data").empty());
}

TEST_F(Ros2Mirror, TwoBoothsAreToldApart) {
  DdsLink a(with_ros2("a-1", "site/left"), clock, no), b(with_ros2("b", "/site/right"), clock, no);
  Node at_a("a-1", "site/left"), at_b("b", "site/right");
  at_a.meet(a);
  at_b.meet(b);
  const FrameRecord frame = posed_frame();
  a.publish(frame);
  const auto tracked = at_a.hear<hri_msgs_msg_dds__IdsList_>(Ros2Topic::tracked);
  ASSERT_TRUE(tracked);
  expect_tracked(*tracked, "a_1", true, frame.captured_utc_ns);
  const auto states = at_a.hear<sensor_msgs_msg_dds__JointState_>(Ros2Topic::joint_states);
  ASSERT_TRUE(states);
  expect_joint_states(*states, "a_1", frame);
  EXPECT_FALSE(at_b.hear<hri_msgs_msg_dds__IdsList_>(Ros2Topic::tracked, 200ms));
  EXPECT_FALSE(at_b.hear<sensor_msgs_msg_dds__JointState_>(Ros2Topic::joint_states, 100ms));
  // /tf is one for all: frames have the booth's name.
  std::optional<Json> tf;
  for (int i = 0; i < 200 && !tf; ++i) {
    tf = at_b.hear<tf2_msgs_msg_dds__TFMessage_>(Ros2Topic::tf, 100ms);
    if (tf && tf->at("transforms")[0].at("child_frame_id") != "body_a_1") tf.reset();  // b's own, from when it was met
    if (!tf) a.publish(frame);
  }
  ASSERT_TRUE(tf);
  expect_tf(*tf, "a_1", frame);
}

TEST_F(Ros2Mirror, WritersAreAsRos2WantsThem) {
  DdsLink link(with_ros2("b"), clock, no);
  Node node("b");
  ASSERT_TRUE(node.matched());
  for (int t = 0; t < daemon::kRos2Topics; ++t) {
    const auto& info = daemon::ros2_topic_info(static_cast<Ros2Topic>(t));
    dds_instance_handle_t writer = 0;
    const dds_entity_t reader = node.readers[static_cast<std::size_t>(t)];
    ASSERT_EQ(dds_get_matched_publications(reader, &writer, 1), 1) << info.ros_type;
    dds_builtintopic_endpoint_t* endpoint = dds_get_matched_publication_data(reader, writer);
    ASSERT_NE(endpoint, nullptr);
    void* data = nullptr;
    std::size_t size = 0;
    ASSERT_TRUE(dds_qget_userdata(endpoint->qos, &data, &size));
    EXPECT_EQ(std::string(static_cast<const char*>(data), size), std::string("typehash=") + info.hash + ";");
    dds_free(data);
    dds_reliability_kind_t reliability{};
    dds_durability_kind_t durability{};
    dds_duration_t patience = 0;
    ASSERT_TRUE(dds_qget_reliability(endpoint->qos, &reliability, &patience) && dds_qget_durability(endpoint->qos, &durability));
    EXPECT_EQ(reliability, DDS_RELIABILITY_RELIABLE);
    EXPECT_EQ(durability, info.latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
    std::uint32_t partitions = 0;
    char** names = nullptr;
    if (dds_qget_partition(endpoint->qos, &partitions, &names)) {
      EXPECT_EQ(partitions, 0u) << "ROS 2 knows no partitions";
      for (std::uint32_t i = 0; i < partitions; ++i) dds_free(names[i]);
      dds_free(names);
    }
    dds_builtintopic_free_endpoint(endpoint);
  }
}

}  // namespace
}  // namespace booth::tests

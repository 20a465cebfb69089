// Heard by another vendor's DDS, the default one of ROS 2: every topic found under its name, type and hash, every field what it must be.
#include <gtest/gtest.h>

#include "daemon/dds/dds_link.hpp"
#include "daemon/dds/ros2/ros2_topics.hpp"
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

TEST(Ros2FastDds, HearsEveryFieldOfEveryTopic) {
  if (!fastdds_is_there()) GTEST_SKIP() << kNoFastDds;
  drivers::SystemClock clock;
  daemon::DdsSettings settings = loopback("front-hall");
  settings.ros2 = daemon::Ros2Settings{.name_space = "site", .cameras = two_cameras()};
  daemon::DdsLink link(settings, clock, [](daemon::DdsCommand) { return daemon::DdsAnswer{}; });
  const daemon::RosNames names("front-hall", "site");

  TemporaryFolder folder;
  Program reader("booth-fastdds-reader", {std::to_string(settings.domain), "ros", names.body, "/site"}, folder.path / "heard");
  ASSERT_TRUE(eventually([&] { return read_lines(reader.output()).matched.size() == daemon::kRos2Topics; }, 60s)) << reader.output();

  // Volatile writers send nothing to whom they have not met: said until a sample of each topic is there.
  const fit::Cloud cloud = numbered_cloud(20'000);
  std::uint64_t n = 0;
  ASSERT_TRUE(eventually(
      [&] {
        const daemon::FrameRecord frame = posed_frame(n += 3);
        link.offer_cloud(cloud, frame.captured_ns);
        link.publish(frame);
        std::this_thread::sleep_for(100ms);
        return read_lines(reader.output()).samples.size() == daemon::kRos2Topics;
      },
      60s))
      << reader.output();

  const Said said = read_lines(reader.output());
  for (int t = 0; t < daemon::kRos2Topics; ++t) {
    const auto topic = static_cast<daemon::Ros2Topic>(t);
    const auto& info = daemon::ros2_topic_info(topic);
    const auto writer = said.writers.find("rt" + daemon::ros2_topic_name(topic, names));
    ASSERT_NE(writer, said.writers.end()) << daemon::ros2_topic_name(topic, names);
    EXPECT_EQ(writer->second.at("type"), info.type->m_typename);
    EXPECT_EQ(writer->second.at("user_data"), std::string("typehash=") + info.hash + ";");
    EXPECT_EQ(writer->second.at("partitions"), 0);
    EXPECT_EQ(writer->second.at("reliable"), true);
    EXPECT_EQ(writer->second.at("transient_local"), info.latched);
  }
  EXPECT_EQ(said.writers.size(), static_cast<std::size_t>(daemon::kRos2Topics)) << "no other topic of ROS 2";
  const auto heard = [&](const std::string& topic) { return said.samples.at(topic); };
  const auto frame = [&](const std::string& topic) { return frame_of(said.samples.at(topic).at("header")); };
  const std::string tracked = "rt/site/humans/bodies/tracked", body = "rt/site/humans/bodies/front_hall";
  expect_tracked(heard(tracked), "front_hall", true, frame(tracked).captured_utc_ns);
  expect_joint_states(heard(body + "/joint_states"), "front_hall", frame(body + "/joint_states"));
  expect_tf(heard("rt/tf"), "front_hall", frame_of(heard("rt/tf").at("transforms").at(0).at("header")));
  expect_tf_static(heard("rt/tf_static"), "front_hall");
  expect_joints(heard(body + "/joints"), "front_hall", frame(body + "/joints"));
  expect_cloud(heard(body + "/cloud"), "front_hall", frame(body + "/cloud"), 20'000, 4096);

  // And nobody: the list is empty, not missing.
  ASSERT_TRUE(eventually(
      [&] {
        link.publish_idle(0);
        std::this_thread::sleep_for(20ms);
        return read_lines(reader.output()).samples.at("rt/site/humans/bodies/tracked").at("ids").empty();
      },
      60s));
}

}  // namespace
}  // namespace booth::tests

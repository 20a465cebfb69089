// boothd with dds.ros2 switched on: its simulated cameras, its fitted person and that person's points reach a node.
#include <gtest/gtest.h>
#include <signal.h>

#include <cstring>

#include "tests/daemon/dds/ros2/ros_node.hpp"
#include "tests/daemon/support/program.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;
using daemon::Ros2Topic;

TEST(Ros2Program, BoothdTellsWhatItFits) {
  TemporaryFolder folder;
  const std::string socket = (folder.path / "c.sock").string();
  std::vector<std::string> arguments;
  for (const auto& value :
       std::vector<std::string>{"booth.id=real-one", "dds.ros2=true", "dds.ros2_namespace=site", "dds.interface=lo", "dds.multicast=false",
                                "dds.domain=" + std::to_string(test_domain()), "cameras.synthetic.motion=a-pose", "control.socket=" + socket,
                                "session.directory=" + (folder.path / "s").string(), "record.directory=" + (folder.path / "r").string()}) {
    arguments.push_back("--set");
    arguments.push_back(value);
  }
  Node node("real-one", "site");
  Program boothd("boothd", arguments, folder.path / "boothd");
  const auto places = node.hear<tf2_msgs_msg_dds__TFMessage_>(Ros2Topic::tf_static, 60s);
  ASSERT_TRUE(places) << boothd.output();
  ASSERT_EQ(places->at("transforms").size(), 4u);
  for (const auto& t : places->at("transforms")) EXPECT_EQ(t.at("header").at("frame_id"), "stage_real_one");
  EXPECT_EQ(places->at("transforms")[0].at("child_frame_id"), "front_left_real_one_optical");

  ASSERT_TRUE(eventually([&] { return Program("boothctl", {"start", "--socket", socket}, folder.path / "start").wait() == 0; }, 60s));
  const auto cloud = node.hear<sensor_msgs_msg_dds__PointCloud2_>(Ros2Topic::cloud, 90s);
  ASSERT_TRUE(cloud) << boothd.output();
  const int points = cloud->at("width").get<int>();
  EXPECT_GT(points, 1000);
  EXPECT_LE(points, 4096);
  // Somebody of human size stands on the stage's floor, near its middle.
  const auto bytes = cloud->at("data").get<std::vector<std::uint8_t>>();
  float lowest = 9, highest = -9, furthest = 0;
  for (int i = 0; i < points; ++i) {
    float p[3];
    std::memcpy(p, bytes.data() + 12 * i, sizeof p);
    lowest = std::min(lowest, p[2]);
    highest = std::max(highest, p[2]);
    furthest = std::max(furthest, std::hypot(p[0], p[1]));
  }
  EXPECT_GT(lowest, -0.1f);
  EXPECT_LT(lowest, 0.3f);
  EXPECT_GT(highest, 1.2f);
  EXPECT_LT(highest, 2.3f);
  EXPECT_LT(furthest, 2.0f);
  const auto tf = node.hear<tf2_msgs_msg_dds__TFMessage_>(Ros2Topic::tf, 60s);
  ASSERT_TRUE(tf);
  const auto& body = tf->at("transforms")[0];
  EXPECT_EQ(body.at("child_frame_id"), "body_real_one");
  EXPECT_GT(body.at("translation")[2].get<double>(), 0.5) << "hips are above the floor";
  boothd.signal(SIGTERM);
  EXPECT_EQ(boothd.wait(), 0) << boothd.output();
}

}  // namespace
}  // namespace booth::tests

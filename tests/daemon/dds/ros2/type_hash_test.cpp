// The hashes that we announce are those of our types, and the way they are computed is ROS 2's.
#include <gtest/gtest.h>

#include "daemon/dds/ros2/body_frames.hpp"
#include "daemon/dds/ros2/ros2_topics.hpp"
#include "tests/daemon/dds/ros2/rihs01.hpp"
#include "tests/daemon/support/temporary_folder.hpp"

namespace booth::tests {
namespace {

std::map<std::string, std::string> hashes() { return rihs01_of_idl(read_text(BOOTH_SOURCE_DIR "/daemon/dds/idl/ros2/ros2_messages.idl")); }

TEST(Ros2TypeHash, IsWhatDistributionsOfRos2Print) {
  // Published by ROS 2 itself (Iron to Kilted), so that the computation here is not only compared with itself.
  const auto now = hashes();
  EXPECT_EQ(now.at("builtin_interfaces/msg/Time"), "RIHS01_b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197");
  EXPECT_EQ(now.at("std_msgs/msg/Header"), "RIHS01_f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01");
  EXPECT_EQ(now.at("geometry_msgs/msg/Point"), "RIHS01_6963084842a9b04494d6b2941d11444708d892da2f4b09843b9c43f42a7f6881");
  EXPECT_EQ(now.at("geometry_msgs/msg/PoseArray"), "RIHS01_af0cc36d190e104d546d168d6b39df04fa4b4ccecf59cb4c9ed328d3d5004aa0");
  EXPECT_EQ(now.at("tf2_msgs/msg/TFMessage"), "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087");
  EXPECT_EQ(now.at("sensor_msgs/msg/JointState"), "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e");
  EXPECT_EQ(now.at("sensor_msgs/msg/PointCloud2"), "RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5");
}

TEST(Ros2TypeHash, OfEachTopicIsThatOfItsType) {
  const auto now = hashes();
  for (int t = 0; t < daemon::kRos2Topics; ++t) {
    const auto& info = daemon::ros2_topic_info(static_cast<daemon::Ros2Topic>(t));
    EXPECT_EQ(now.at(info.ros_type), info.hash) << info.ros_type;
    // pkg/msg/Name and pkg::msg::dds_::Name_ are the same type.
    const std::string ros = info.ros_type, dds = info.type->m_typename;
    EXPECT_EQ(dds, ros.substr(0, ros.find('/')) + "::msg::dds_::" + ros.substr(ros.rfind('/') + 1) + "_");
    const std::uint32_t first = info.type->m_ops[0] & DDS_OP_MASK;
    EXPECT_TRUE(first != DDS_OP_DLC && first != DDS_OP_PLC) << dds << " is not @final";
    EXPECT_EQ(info.type->m_nkeys, 0u) << dds;
  }
}

TEST(Ros2Page, NamesEveryTopicTypeAndFrame) {
  const std::string page = read_text(BOOTH_SOURCE_DIR "/docs/reference/ros2.md");
  daemon::RosNames names("x", "");
  for (int t = 0; t < daemon::kRos2Topics; ++t) {
    const auto topic = static_cast<daemon::Ros2Topic>(t);
    const auto& info = daemon::ros2_topic_info(topic);
    std::string name = daemon::ros2_topic_name(topic, names);
    if (const auto id = name.find("/x/"); id != std::string::npos) name.replace(id, 3, "/<id>/");
    const auto row = page.find("| `" + name + "` | `" + info.ros_type + "` | ");
    ASSERT_NE(row, std::string::npos) << name;
    const std::string line = page.substr(row, page.find('\n', row) - row);
    EXPECT_NE(line.find(" | " + std::to_string(info.depth) + (info.latched ? ", transient local |" : " |")), std::string::npos) << line;
  }
  for (const auto& frame : daemon::body_frames()) {
    std::string link = frame.link;
    if (link.starts_with("l_") || link.starts_with("r_")) link = link.substr(2);
    EXPECT_NE(page.find("`" + link + "`"), std::string::npos) << frame.link;
  }
}

TEST(Ros2TypeHash, ChangesWithAnyMember) {
  std::string idl = read_text(BOOTH_SOURCE_DIR "/daemon/dds/idl/ros2/ros2_messages.idl");
  const auto before = rihs01_of_idl(idl);
  idl.replace(idl.find("string frame_id"), 15, "string frame_ID");
  const auto after = rihs01_of_idl(idl);
  EXPECT_NE(before.at("std_msgs/msg/Header"), after.at("std_msgs/msg/Header"));
  EXPECT_NE(before.at("tf2_msgs/msg/TFMessage"), after.at("tf2_msgs/msg/TFMessage")) << "it is inside";
  EXPECT_EQ(before.at("geometry_msgs/msg/Point"), after.at("geometry_msgs/msg/Point"));
}

}  // namespace
}  // namespace booth::tests

// What a booth and its cameras may be called becomes names that ROS 2 accepts.
#include <gtest/gtest.h>

#include "daemon/dds/ros2/ros_names.hpp"

namespace booth::daemon {
namespace {

TEST(RosNames, BecomeTokens) {
  EXPECT_EQ(ros_token("lobby"), "lobby");
  EXPECT_EQ(ros_token("Hall_3"), "Hall_3");
  EXPECT_EQ(ros_token("front-left"), "front_left");
  EXPECT_EQ(ros_token("a--b__c"), "a_b_c") << "ROS 2 allows no underscores beside each other";
  EXPECT_EQ(ros_token("_x_"), "x") << "a leading underscore hides a topic";
  EXPECT_EQ(ros_token("3rd"), "b3rd") << "a token does not begin with a digit";
  EXPECT_EQ(ros_token("---"), "booth");
  EXPECT_EQ(ros_token("caf\xC3\xA9 1"), "caf_1");
}

TEST(RosNames, AlikeOnesAreNumbered) {
  EXPECT_EQ(ros_tokens({"a-b", "a_b", "c", "a b"}), (std::vector<std::string>{"a_b", "a_b_2", "c", "a_b_3"}));
  EXPECT_EQ(ros_tokens({"a_2", "a", "a"}), (std::vector<std::string>{"a_2", "a", "a_3"})) << "never one that is taken";
}

TEST(RosNames, ANamespaceIsTokensBetweenSlashes) {
  for (const char* good : {"", "hall", "/hall", "/site/hall_2"}) EXPECT_EQ(ros_namespace_problem(good), "") << good;
  for (const char* bad : {"/", "hall/", "//hall", "2hall", "a b", "a__b", "_a", "hall/../x", "h\xC3\xA4ll"}) EXPECT_NE(ros_namespace_problem(bad), "") << bad;
  EXPECT_NE(ros_namespace_problem(std::string(65, 'a')), "");
}

TEST(RosNames, TopicsAndFramesOfABooth) {
  const RosNames plain("front-hall", "");
  EXPECT_EQ(plain.id, "front_hall");
  EXPECT_EQ(plain.tracked, "/humans/bodies/tracked");
  EXPECT_EQ(plain.body_topic("joint_states"), "/humans/bodies/front_hall/joint_states");
  EXPECT_EQ(plain.stage, "stage_front_hall");
  EXPECT_EQ(plain.frame("head"), "head_front_hall");
  EXPECT_EQ(RosNames("x", "site/hall").tracked, "/site/hall/humans/bodies/tracked");
  EXPECT_EQ(RosNames("x", "/hall").body_topic("cloud"), "/hall/humans/bodies/x/cloud");
}

}  // namespace
}  // namespace booth::daemon

// The ROS 2 topics of a booth, read with Fast DDS.
#include "ros_viewPubSubTypes.h"  // made from idl/ros_view.idl by fastddsgen
#include "tests/daemon/dds/ros2/fastdds_ear.hpp"

namespace booth::tests::fastdds {
namespace {

Json json(const std_msgs::msg::dds_::Header_& h) { return {{"sec", h.stamp().sec()}, {"nanosec", h.stamp().nanosec()}, {"frame_id", h.frame_id()}}; }
template <class Xyz>
Json xyz(const Xyz& v) {
  return {v.x(), v.y(), v.z()};
}
Json json(const geometry_msgs::msg::dds_::Quaternion_& q) { return {q.x(), q.y(), q.z(), q.w()}; }

Json json(const hri_msgs::msg::dds_::IdsList_& m) { return {{"header", json(m.header())}, {"ids", m.ids()}}; }
Json json(const sensor_msgs::msg::dds_::JointState_& m) {
  return {{"header", json(m.header())}, {"name", m.name()}, {"position", m.position()}, {"velocity", m.velocity()}, {"effort", m.effort()}};
}
Json json(const tf2_msgs::msg::dds_::TFMessage_& m) {
  Json out = Json::array();
  for (const auto& t : m.transforms())
    out.push_back({{"header", json(t.header())},
                   {"child_frame_id", t.child_frame_id()},
                   {"translation", xyz(t.transform().translation())},
                   {"rotation", json(t.transform().rotation())}});
  return {{"transforms", out}};
}
Json json(const geometry_msgs::msg::dds_::PoseArray_& m) {
  Json poses = Json::array();
  for (const auto& p : m.poses()) poses.push_back({{"position", xyz(p.position())}, {"orientation", json(p.orientation())}});
  return {{"header", json(m.header())}, {"poses", poses}};
}
Json json(const sensor_msgs::msg::dds_::PointCloud2_& m) {
  Json fields = Json::array();
  for (const auto& f : m.fields()) fields.push_back({{"name", f.name()}, {"offset", f.offset()}, {"datatype", f.datatype()}, {"count", f.count()}});
  return {{"header", json(m.header())},   {"height", m.height()},     {"width", m.width()}, {"fields", fields},        {"is_bigendian", m.is_bigendian()},
          {"point_step", m.point_step()}, {"row_step", m.row_step()}, {"data", m.data()},   {"is_dense", m.is_dense()}};
}

}  // namespace

void hear_ros(efd::DomainParticipant& participant, const std::string& body, const std::string& name_space) {
  efd::Subscriber& subscriber = *participant.create_subscriber(efd::SUBSCRIBER_QOS_DEFAULT);
  // What rclcpp asks for by default, and tf2's listener for the static frames.
  static const Ear<hri_msgs::msg::dds_::IdsList_, hri_msgs::msg::dds_::IdsList_PubSubType> tracked(
      participant, subscriber, "rt" + name_space + "/humans/bodies/tracked", Service::reliable, json);
  static const Ear<sensor_msgs::msg::dds_::JointState_, sensor_msgs::msg::dds_::JointState_PubSubType> states(
      participant, subscriber, "rt" + body + "/joint_states", Service::reliable, json);
  using Tf = Ear<tf2_msgs::msg::dds_::TFMessage_, tf2_msgs::msg::dds_::TFMessage_PubSubType>;
  static const Tf tf(participant, subscriber, "rt/tf", Service::reliable, json), tf_static(participant, subscriber, "rt/tf_static", Service::latched, json);
  // As rviz2 does with sensors' data.
  static const Ear<geometry_msgs::msg::dds_::PoseArray_, geometry_msgs::msg::dds_::PoseArray_PubSubType> joints(
      participant, subscriber, "rt" + body + "/joints", Service::best_effort, json);
  static const Ear<sensor_msgs::msg::dds_::PointCloud2_, sensor_msgs::msg::dds_::PointCloud2_PubSubType> cloud(participant, subscriber, "rt" + body + "/cloud",
                                                                                                               Service::reliable, json);
}

}  // namespace booth::tests::fastdds

// One table of topics, and the writers made from it.
#include "daemon/dds/ros2/ros2_topics.hpp"

#include "daemon/dds/participant.hpp"
#include "daemon/dds/topics.hpp"
#include "ros2_messages.h"

namespace booth::daemon {

const Ros2TopicInfo& ros2_topic_info(Ros2Topic topic) {
  static constexpr const char* kTfHash = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
  static const std::array<Ros2TopicInfo, kRos2Topics> kTopics{
      {{"hri_msgs/msg/IdsList", "RIHS01_7e0812d1ac945c98fd3e393568d581ad0ab567f37b24eff633eab778c1bfe62d", &hri_msgs_msg_dds__IdsList__desc, 10, false},
       {"sensor_msgs/msg/JointState", "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e", &sensor_msgs_msg_dds__JointState__desc, 10,
        false},
       // As deep as ROS 2's own broadcasters: a listener wants the way here, not only the last point of it.
       {"tf2_msgs/msg/TFMessage", kTfHash, &tf2_msgs_msg_dds__TFMessage__desc, 100, false},
       {"tf2_msgs/msg/TFMessage", kTfHash, &tf2_msgs_msg_dds__TFMessage__desc, 1, true},
       {"geometry_msgs/msg/PoseArray", "RIHS01_af0cc36d190e104d546d168d6b39df04fa4b4ccecf59cb4c9ed328d3d5004aa0", &geometry_msgs_msg_dds__PoseArray__desc, 10,
        false},
       // A cloud is large and the next one is better: a slow reader misses some.
       {"sensor_msgs/msg/PointCloud2", "RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5", &sensor_msgs_msg_dds__PointCloud2__desc, 2,
        false}}};
  return kTopics[static_cast<std::size_t>(topic)];
}

std::string ros2_topic_name(Ros2Topic topic, const RosNames& names) {
  switch (topic) {
    case Ros2Topic::tracked:
      return names.tracked;
    case Ros2Topic::joint_states:
      return names.body_topic("joint_states");
    case Ros2Topic::tf:
      return "/tf";
    case Ros2Topic::tf_static:
      return "/tf_static";
    case Ros2Topic::joints:
      return names.body_topic("joints");
    case Ros2Topic::cloud:
      return names.body_topic("cloud");
  }
  return "";
}

dds_entity_t make_ros2_writer(dds_entity_t participant, dds_entity_t publisher, Ros2Topic topic, const RosNames& names) {
  const Ros2TopicInfo& info = ros2_topic_info(topic);
  const DdsQos qos;
  dds_data_representation_id_t xcdr1 = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos, 1, &xcdr1);
  // Reliable serves readers that ask for best effort, too. A writer that would have to wait gives up at once, and keep last never has to.
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, 0);
  dds_qset_durability(qos, info.latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, info.depth);
  dds_qset_writer_data_lifecycle(qos, false);
  const std::string hash = std::string("typehash=") + info.hash + ";";
  dds_qset_userdata(qos, hash.data(), hash.size());
  const std::string name = "rt" + ros2_topic_name(topic, names);
  const dds_entity_t made = dds_check(dds_create_topic(participant, info.type, name.c_str(), nullptr, nullptr), name);
  return dds_check(dds_create_writer(publisher, made, qos, nullptr), name);
}

}  // namespace booth::daemon

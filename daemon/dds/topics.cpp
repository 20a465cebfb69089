// One table of topics, one switch of policies.
#include "daemon/dds/topics.hpp"

#include "booth.h"
#include "daemon/dds/participant.hpp"

namespace booth::daemon {

const DdsTopicInfo& topic_info(DdsTopic topic) {
  static const std::array<DdsTopicInfo, kDdsTopics> kTopics{{{"booth/skeleton", &booth_msg_Skeleton_desc},
                                                             {"booth/body", &booth_msg_Body_desc},
                                                             {"booth/status", &booth_msg_Status_desc},
                                                             {"booth/event", &booth_msg_Event_desc},
                                                             {"booth/command", &booth_msg_Command_desc},
                                                             {"booth/reply", &booth_msg_Reply_desc}}};
  return kTopics[static_cast<std::size_t>(topic)];
}

void set_topic_qos(DdsTopic topic, const DdsQos& qos) {
  dds_data_representation_id_t xcdr1 = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos, 1, &xcdr1);
  switch (topic) {
    case DdsTopic::skeleton:
      dds_qset_reliability(qos, DDS_RELIABILITY_BEST_EFFORT, 0);
      dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
      dds_qset_deadline(qos, kSkeletonDeadline);
      dds_qset_liveliness(qos, DDS_LIVELINESS_AUTOMATIC, kSkeletonLease);
      break;
    case DdsTopic::body:
    case DdsTopic::status:
      // A writer that would have to wait gives up at once: nobody in the booth waits for a reader.
      dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, 0);
      dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
      dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
      break;
    case DdsTopic::event:
    case DdsTopic::reply:
      // Keep last, because a reader that never acknowledges would fill a keep-all history and silence the booth for everybody else.
      dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, 0);
      dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, kHistory);
      break;
    case DdsTopic::command:
      // Keep last here, too: a full keep-all reader would stop the library's receiving thread.
      dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
      dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, kCommandHistory);
      break;
  }
}

namespace {
dds_entity_t make_topic(dds_entity_t participant, const DdsTopicInfo& info) {
  return dds_check(dds_create_topic(participant, info.type, info.name, nullptr, nullptr), info.name);
}
}  // namespace

dds_entity_t make_writer(dds_entity_t participant, dds_entity_t publisher, DdsTopic topic) {
  const DdsQos qos;
  set_topic_qos(topic, qos);
  return dds_check(dds_create_writer(publisher, make_topic(participant, topic_info(topic)), qos, nullptr), topic_info(topic).name);
}

dds_entity_t make_reader(dds_entity_t participant, dds_entity_t subscriber, DdsTopic topic) {
  const DdsQos qos;
  set_topic_qos(topic, qos);
  return dds_check(dds_create_reader(subscriber, make_topic(participant, topic_info(topic)), qos, nullptr), topic_info(topic).name);
}

}  // namespace booth::daemon

// The topics of a booth and the quality of service of each, for writers and for readers alike; the reasons are in docs/reference/dds.md.
#pragma once

#include <dds/dds.h>

#include <array>
#include <cstdint>

namespace booth::daemon {

enum class DdsTopic : std::uint8_t { skeleton, body, status, event, command, reply };
inline constexpr int kDdsTopics = 6;

struct DdsTopicInfo {
  const char* name;
  const dds_topic_descriptor_t* type;
};
const DdsTopicInfo& topic_info(DdsTopic topic);

/// Owns a library's set of policies.
class DdsQos {
 public:
  DdsQos() : qos_(dds_create_qos()) {}
  ~DdsQos() { dds_delete_qos(qos_); }
  DdsQos(const DdsQos&) = delete;
  operator dds_qos_t*() const { return qos_; }  // NOLINT(google-explicit-constructor): it stands for the library's handle

 private:
  dds_qos_t* qos_;
};

inline constexpr std::int64_t kSkeletonDeadline = DDS_MSECS(100), kSkeletonLease = DDS_MSECS(500);
inline constexpr int kHistory = 1000;       ///< samples of booth/event and of booth/reply that wait for a slow reader; the oldest go first
inline constexpr int kCommandHistory = 32;  ///< commands that wait for the booth

/// Fills `qos` with what the booth's end of the topic uses.
void set_topic_qos(DdsTopic topic, const DdsQos& qos);

/// A writer or reader of the topic with the topic's quality of service. Throws as dds_check().
dds_entity_t make_writer(dds_entity_t participant, dds_entity_t publisher, DdsTopic topic);
dds_entity_t make_reader(dds_entity_t participant, dds_entity_t subscriber, DdsTopic topic);

}  // namespace booth::daemon

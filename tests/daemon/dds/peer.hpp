// Another program on the domain, as tests of DDS play it: readers and writers of any type, and a patient take.
#pragma once

#include <dds/dds.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <string>
#include <thread>

#include "booth.h"
#include "daemon/dds/dds_settings.hpp"

namespace booth::tests {

/// Tests that run side by side do not hear each other.
inline std::uint32_t test_domain() { return static_cast<std::uint32_t>(100 + ::getpid() % 100); }

inline daemon::DdsSettings loopback(const std::string& booth, std::uint32_t domain = test_domain()) {
  return {.booth = booth, .domain = domain, .interface = "lo", .multicast = false, .peers = {}};
}

class Peer {
 public:
  /// Opens the domain with the loopback settings where nobody of this process has done so.
  explicit Peer(const char* partition, std::uint32_t domain = test_domain()) {
    domain_ = dds_create_domain(domain, daemon::dds_configuration(loopback(partition)).c_str());
    participant_ = dds_create_participant(domain, nullptr, nullptr);
    dds_qos_t* qos = dds_create_qos();
    dds_qset_partition(qos, 1, &partition);
    subscriber_ = dds_create_subscriber(participant_, qos, nullptr);
    publisher_ = dds_create_publisher(participant_, qos, nullptr);
    dds_delete_qos(qos);
  }
  ~Peer() {
    dds_delete(participant_);
    if (domain_ > 0) dds_delete(domain_);
  }
  Peer(const Peer&) = delete;

  dds_entity_t topic(const dds_topic_descriptor_t& type, const char* name) { return dds_create_topic(participant_, &type, name, nullptr, nullptr); }

  dds_entity_t reader(const dds_topic_descriptor_t& type, const char* name, bool reliable, bool transient = false, int depth = 2000) {
    dds_qos_t* qos = dds_create_qos();
    dds_qset_reliability(qos, reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, DDS_SECS(1));
    if (transient) dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, depth);
    const dds_entity_t out = dds_create_reader(subscriber_, topic(type, name), qos, nullptr);
    dds_delete_qos(qos);
    return out;
  }
  dds_entity_t writer(const dds_topic_descriptor_t& type, const char* name) {
    dds_qos_t* qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    const dds_entity_t out = dds_create_writer(publisher_, topic(type, name), qos, nullptr);
    dds_delete_qos(qos);
    return out;
  }

  dds_entity_t domain_, participant_, subscriber_, publisher_;
};

inline bool has_writer(dds_entity_t reader) {
  dds_subscription_matched_status_t status{};
  return dds_get_subscription_matched_status(reader, &status) == 0 && status.current_count > 0;
}
inline bool has_reader(dds_entity_t writer) {
  dds_publication_matched_status_t status{};
  return dds_get_publication_matched_status(writer, &status) == 0 && status.current_count > 0;
}

/// Takes one sample within the limit and lets `look` see it; false when none came.
template <class T, class F>
bool take(dds_entity_t reader, F look, std::chrono::milliseconds limit = std::chrono::seconds(20)) {
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (true) {
    void* samples[1] = {nullptr};
    dds_sample_info_t info[1];
    if (dds_take(reader, samples, info, 1, 1) == 1) {
      const bool valid = info[0].valid_data;
      if (valid) look(*static_cast<const T*>(samples[0]));
      (void)dds_return_loan(reader, samples, 1);
      if (valid) return true;
      continue;  // a change of state without a value
    }
    if (std::chrono::steady_clock::now() >= deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

/// A command as an honest client sends it.
inline booth_msg_Command command(const char* booth, const char* sender, std::uint64_t id, booth_msg_CommandKind kind) {
  booth_msg_Command out{};
  std::strncpy(out.booth, booth, sizeof out.booth - 1);
  std::strncpy(out.sender, sender, sizeof out.sender - 1);
  out.version = booth_msg_VERSION;
  out.id = id;
  out.utc_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch()).count();
  out.kind = kind;
  return out;
}

}  // namespace booth::tests

// How every program of ours joins a domain: the one place in which a participant's settings are built.
#pragma once

#include <dds/dds.h>

#include <string>

#include "daemon/dds/dds_settings.hpp"
#include "daemon/dds/topics.hpp"

namespace booth::daemon {

/// Throws std::runtime_error naming what DDS refused and which key to look at; otherwise hands the entity on.
dds_entity_t dds_check(dds_entity_t entity, const std::string& what);

/// Names the built-in plugins of DDS Security 1.1 (clauses 9.3 to 9.5) and what they read in the properties of a participant to be made. Properties with these
/// names are never told to others.
void set_identity(const DdsQos& qos, const DdsIdentity& identity);

/// A participant with a publisher and a subscriber in the partition settings.booth. Leaves the domain when it goes. Not thread-safe itself; its entities are.
class DdsParticipant {
 public:
  explicit DdsParticipant(const DdsSettings& settings);
  ~DdsParticipant();
  DdsParticipant(const DdsParticipant&) = delete;

  dds_entity_t participant() const { return participant_; }
  dds_entity_t publisher() const { return publisher_; }
  dds_entity_t subscriber() const { return subscriber_; }

 private:
  void close();
  dds_entity_t domain_ = 0, participant_ = 0, publisher_ = 0, subscriber_ = 0;
};

}  // namespace booth::daemon

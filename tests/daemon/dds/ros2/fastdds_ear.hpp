// What every reader made of Fast DDS here has: a participant on the loopback interface, and ears that say as JSON what they hear.
#pragma once

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <cstdint>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <iostream>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace booth::tests::fastdds {

namespace efd = eprosima::fastdds::dds;
namespace efr = eprosima::fastrtps::rtps;
using Json = nlohmann::json;

inline void say(const Json& line) {
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  std::cout << line.dump(-1, ' ', true, Json::error_handler_t::replace) << std::endl;
}

enum class Service : std::uint8_t { best_effort, reliable, latched };

/// Hears one topic and says each sample as `to_json` puts it.
template <class Type, class Support>
class Ear final : public efd::DataReaderListener {
 public:
  Ear(efd::DomainParticipant& participant, efd::Subscriber& subscriber, const std::string& topic, Service service, Json (*to_json)(const Type&))
      : topic_(topic), to_json_(to_json) {
    efd::TypeSupport support(new Support);
    support.register_type(&participant);
    efd::Topic* made = participant.create_topic(topic, support.get_type_name(), efd::TOPIC_QOS_DEFAULT);
    efd::DataReaderQos qos = efd::DATAREADER_QOS_DEFAULT;
    qos.reliability().kind = service == Service::best_effort ? efd::BEST_EFFORT_RELIABILITY_QOS : efd::RELIABLE_RELIABILITY_QOS;
    qos.durability().kind = service == Service::latched ? efd::TRANSIENT_LOCAL_DURABILITY_QOS : efd::VOLATILE_DURABILITY_QOS;
    qos.history().kind = efd::KEEP_LAST_HISTORY_QOS;
    qos.history().depth = 10;
    qos.endpoint().history_memory_policy = efr::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    if (!made || !subscriber.create_datareader(made, qos, this)) {
      std::cerr << "no reader of " << topic << "\n";
      std::exit(1);
    }
  }
  void on_data_available(efd::DataReader* reader) override {
    Type sample;
    efd::SampleInfo info;
    while (reader->take_next_sample(&sample, &info) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK)
      if (info.valid_data) say({{"topic", topic_}, {"sample", to_json_(sample)}});
  }
  void on_subscription_matched(efd::DataReader*, const efd::SubscriptionMatchedStatus& status) override {
    if (status.current_count_change > 0) say({{"matched", topic_}});
  }

 private:
  std::string topic_;
  Json (*to_json_)(const Type&);
};

/// The loopback interface without multicast, where the booth of a test is.
inline efd::DomainParticipantQos loopback(std::uint32_t domain) {
  efd::DomainParticipantQos qos = efd::PARTICIPANT_QOS_DEFAULT;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.emplace_back("127.0.0.1");
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  auto& builtin = qos.wire_protocol().builtin;
  builtin.avoid_builtin_multicast = true;
  builtin.discovery_config.leaseDuration_announcementperiod = {1, 0};
  for (std::uint32_t i = 0; i < 8; ++i) {
    // Ports of the protocol's rule: where the first participants of the domain listen for others.
    efr::Locator_t peer;
    eprosima::fastrtps::rtps::IPLocator::setIPv4(peer, 127, 0, 0, 1);
    peer.port = 7400 + 250 * domain + 10 + 2 * i;
    builtin.initialPeersList.push_back(peer);
  }
  return qos;
}

/// Each makes its readers and returns; what they hear is said from then on.
void hear_ros(efd::DomainParticipant& participant, const std::string& body, const std::string& name_space);
void hear_booth(efd::DomainParticipant& participant, const std::string& booth);

}  // namespace booth::tests::fastdds

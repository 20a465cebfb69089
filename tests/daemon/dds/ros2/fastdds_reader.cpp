// A reader of a booth's ROS 2 topics made of another vendor's DDS: writes what it finds and hears as lines of JSON, until it is killed.
#include <signal.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
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

#include "ros_viewPubSubTypes.h"  // made from idl/ros_view.idl by fastddsgen

namespace {

namespace efd = eprosima::fastdds::dds;
namespace efr = eprosima::fastrtps::rtps;
using Json = nlohmann::json;

void say(const Json& line) {
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  std::cout << line.dump(-1, ' ', true, Json::error_handler_t::replace) << std::endl;
}

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

/// Hears one topic.
template <class Type, class Support>
class Ear final : public efd::DataReaderListener {
 public:
  Ear(efd::DomainParticipant& participant, efd::Subscriber& subscriber, const std::string& topic, bool latched) : topic_(topic) {
    efd::TypeSupport support(new Support);
    support.register_type(&participant);
    efd::Topic* made = participant.create_topic("rt" + topic, support.get_type_name(), efd::TOPIC_QOS_DEFAULT);
    efd::DataReaderQos qos = efd::DATAREADER_QOS_DEFAULT;
    // What rclcpp asks for by default, and tf2's listener for the static frames.
    qos.reliability().kind = efd::RELIABLE_RELIABILITY_QOS;
    qos.durability().kind = latched ? efd::TRANSIENT_LOCAL_DURABILITY_QOS : efd::VOLATILE_DURABILITY_QOS;
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
      if (info.valid_data) say({{"topic", topic_}, {"sample", json(sample)}});
  }
  void on_subscription_matched(efd::DataReader*, const efd::SubscriptionMatchedStatus& status) override {
    if (status.current_count_change > 0) say({{"matched", topic_}});
  }

 private:
  std::string topic_;
};

/// Says which writers of ROS 2 topics there are.
struct Discovery final : efd::DomainParticipantListener {
  void on_publisher_discovery(efd::DomainParticipant*, efr::WriterDiscoveryInfo&& info) override {
    if (info.status != efr::WriterDiscoveryInfo::DISCOVERED_WRITER) return;
    const std::string topic = info.info.topicName().to_string();
    if (topic.rfind("rt/", 0) != 0) return;
    const auto& data = info.info.m_qos.m_userData;
    say({{"writer", topic},
         {"type", info.info.typeName().to_string()},
         {"user_data", std::string(data.begin(), data.end())},
         {"partitions", info.info.m_qos.m_partition.size()},
         {"reliable", info.info.m_qos.m_reliability.kind == efd::RELIABLE_RELIABILITY_QOS},
         {"transient_local", info.info.m_qos.m_durability.kind == efd::TRANSIENT_LOCAL_DURABILITY_QOS}});
  }
};

/// The loopback interface without multicast, where the booth of a test is.
efd::DomainParticipantQos loopback(std::uint32_t domain) {
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

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::cerr << "usage: booth-fastdds-reader DOMAIN TOPIC_OF_THE_BODY [NAMESPACE]\n";
    return 64;
  }
  const auto domain = static_cast<std::uint32_t>(std::atoi(argv[1]));
  const std::string body = argv[2], name_space = argc > 3 ? argv[3] : "";
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // nothing of a test outlives it
  Discovery discovery;
  auto* factory = efd::DomainParticipantFactory::get_instance();
  efd::DomainParticipant* participant = factory->create_participant(domain, loopback(domain), &discovery, efd::StatusMask::none());
  if (!participant) {
    std::cerr << "no participant\n";
    return 1;
  }
  efd::Subscriber* subscriber = participant->create_subscriber(efd::SUBSCRIBER_QOS_DEFAULT);
  const Ear<hri_msgs::msg::dds_::IdsList_, hri_msgs::msg::dds_::IdsList_PubSubType> tracked(*participant, *subscriber, name_space + "/humans/bodies/tracked",
                                                                                            false);
  const Ear<sensor_msgs::msg::dds_::JointState_, sensor_msgs::msg::dds_::JointState_PubSubType> states(*participant, *subscriber, body + "/joint_states",
                                                                                                       false);
  const Ear<tf2_msgs::msg::dds_::TFMessage_, tf2_msgs::msg::dds_::TFMessage_PubSubType> tf(*participant, *subscriber, "/tf", false);
  const Ear<tf2_msgs::msg::dds_::TFMessage_, tf2_msgs::msg::dds_::TFMessage_PubSubType> tf_static(*participant, *subscriber, "/tf_static", true);
  const Ear<geometry_msgs::msg::dds_::PoseArray_, geometry_msgs::msg::dds_::PoseArray_PubSubType> joints(*participant, *subscriber, body + "/joints", false);
  const Ear<sensor_msgs::msg::dds_::PointCloud2_, sensor_msgs::msg::dds_::PointCloud2_PubSubType> cloud(*participant, *subscriber, body + "/cloud", false);
  while (true) ::pause();
}

// A listener to a booth made of another vendor's DDS: writes what it finds and hears as lines of JSON, until it is killed.
#include <signal.h>
#include <sys/prctl.h>
#include <unistd.h>

#include "tests/daemon/dds/ros2/fastdds_ear.hpp"

namespace {

using namespace booth::tests::fastdds;

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

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 3 ? argv[2] : "";
  if (what != "ros" && what != "booth") {
    std::cerr << "usage: booth-fastdds-reader DOMAIN ros TOPIC_OF_THE_BODY [NAMESPACE]\n"
                 "       booth-fastdds-reader DOMAIN booth BOOTH    which is told to start, too\n";
    return 64;
  }
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // nothing of a test outlives it
  Discovery discovery;
  const auto domain = static_cast<std::uint32_t>(std::atoi(argv[1]));
  efd::DomainParticipant* participant =
      efd::DomainParticipantFactory::get_instance()->create_participant(domain, loopback(domain), &discovery, efd::StatusMask::none());
  if (!participant) {
    std::cerr << "no participant\n";
    return 1;
  }
  if (what == "ros")
    hear_ros(*participant, argv[3], argc > 4 ? argv[4] : "");
  else
    hear_booth(*participant, argv[3]);
  while (true) ::pause();
}

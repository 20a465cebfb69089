// A program that subscribes to everything of one booth, says so and then never reads: what a hung console, or a hung node of ROS 2, is to the booth.
#include <cstdlib>
#include <string>
#include <vector>

#include "daemon/dds/booth_listener.hpp"
#include "daemon/dds/ros2/ros2_topics.hpp"
#include "tests/daemon/dds/peer.hpp"

int main(int argc, char** argv) {
  using namespace booth;
  if (argc < 4) return 64;
  const auto domain = static_cast<std::uint32_t>(std::atoi(argv[1]));
  const char* booth = argv[2];
  const int ready = std::atoi(argv[3]);
  tests::Peer peer(booth, domain);
  std::vector<dds_entity_t> readers{peer.reader(booth_msg_Skeleton_desc, "booth/skeleton", false),
                                    peer.reader(booth_msg_Status_desc, "booth/status", true, true), peer.reader(booth_msg_Event_desc, "booth/event", true),
                                    peer.reader(booth_msg_Reply_desc, "booth/reply", true)};
  tests::Peer node("", domain);
  for (int t = 0; argc > 4 && std::string(argv[4]) == "ros2" && t < daemon::kRos2Topics; ++t) {
    const auto topic = static_cast<daemon::Ros2Topic>(t);
    const auto& info = daemon::ros2_topic_info(topic);
    readers.push_back(node.reader(*info.type, ("rt" + daemon::ros2_topic_name(topic, daemon::RosNames(booth, ""))).c_str(), true, info.latched));
  }
  for (int i = 0; i < 12000; ++i) {
    bool all = true;
    for (const dds_entity_t reader : readers) all = all && tests::has_writer(reader);
    if (all) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  if (::write(ready, "!", 1) != 1) return 1;
  ::pause();
}

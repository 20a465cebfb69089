// A complete subscriber: prints where the head of the person in each booth is.
#include <dds/dds.h>

#include <chrono>
#include <cstdio>
#include <thread>

#include "booth.h"  // made from booth.idl by idlc

int main(int argc, char** argv) {
  const char* booth = argc > 1 ? argv[1] : "*";  // a booth.id, or all booths
  const dds_entity_t participant = dds_create_participant(DDS_DOMAIN_DEFAULT, nullptr, nullptr);
  dds_qos_t* partition = dds_create_qos();
  dds_qset_partition(partition, 1, &booth);
  const dds_entity_t subscriber = dds_create_subscriber(participant, partition, nullptr);
  const dds_entity_t topic = dds_create_topic(participant, &booth_msg_Skeleton_desc, "booth/skeleton", nullptr, nullptr);
  const dds_entity_t reader = dds_create_reader(subscriber, topic, nullptr, nullptr);
  if (reader < 0) return std::fprintf(stderr, "no reader: %s\n", dds_strretcode(-reader)), 1;
  while (true) {
    void* sample[1] = {nullptr};
    dds_sample_info_t info[1];
    while (dds_take(reader, sample, info, 1, 1) == 1) {
      const auto& s = *static_cast<const booth_msg_Skeleton*>(sample[0]);
      if (!info[0].valid_data)
        std::printf("%s is gone\n", s.booth);
      else if (s.person == booth_msg_PERSON_LOST)
        std::printf("%s: nobody\n", s.booth);
      else
        std::printf("%s: head at %.3f %.3f %.3f m\n", s.booth, s.joints[23].position[0], s.joints[23].position[1], s.joints[23].position[2]);
      std::fflush(stdout);
      dds_return_loan(reader, sample, 1);
      sample[0] = nullptr;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

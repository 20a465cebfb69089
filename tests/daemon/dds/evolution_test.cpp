// The rule of evolution (docs/design/dds-evolution.md), tried with old and new readers and writers; and the proof that released types stand still.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <map>
#include <sstream>

#include "daemon/dds/dds_link.hpp"
#include "daemon/dds/topics.hpp"
#include "drivers/clock/system_clock.hpp"
#include "next.h"
#include "tests/daemon/dds/peer.hpp"

namespace booth::tests {
namespace {

using namespace std::chrono_literals;
using daemon::DdsLink;
using daemon::DdsTopic;

/// Names, types and order of all members, as XTypes writes them: a number that changes with any of them.
std::string fingerprint(const dds_topic_descriptor_t& type) {
  std::uint64_t hash = 1469598103934665603u;
  for (std::uint32_t i = 0; i < type.type_mapping.sz; ++i) hash = (hash ^ type.type_mapping.data[i]) * 1099511628211u;
  std::ostringstream out;
  out << std::hex << hash;
  return out.str();
}

TEST(DdsEvolution, ReleasedTypesStandStill) {
  std::ostringstream now;
  for (int t = 0; t < daemon::kDdsTopics; ++t) {
    const auto& info = daemon::topic_info(static_cast<DdsTopic>(t));
    now << info.name << " " << info.type->m_typename << " " << fingerprint(*info.type) << "\n";
  }
  const std::string path = std::string(BOOTH_SOURCE_DIR) + "/tests/golden/dds-types.txt";
  std::ifstream in(path);
  const std::string golden{std::istreambuf_iterator<char>(in), {}};
  EXPECT_EQ(golden, now.str()) << "a type that was released must not change: give the new one a new name and topic (docs/design/dds-evolution.md)";
}

TEST(DdsEvolution, EveryTypeIsFinal) {
  for (int t = 0; t < daemon::kDdsTopics; ++t) {
    const auto& info = daemon::topic_info(static_cast<DdsTopic>(t));
    // An appendable or mutable type begins with an instruction of its own, and needs XCDR2, which not every vendor reads.
    const std::uint32_t first = info.type->m_ops[0] & DDS_OP_MASK;
    EXPECT_TRUE(first != DDS_OP_DLC && first != DDS_OP_PLC) << info.name << " is not @final";
  }
}

TEST(DdsEvolution, ADotIsNoPartOfATopicsName) {
  // Why the second type of a topic is _v2: Cyclone DDS refuses other names.
  Peer peer("b");
  EXPECT_LT(peer.topic(booth_msg_SkeletonV2_desc, "booth/skeleton.v2"), 0);
  EXPECT_GT(peer.topic(booth_msg_SkeletonV2_desc, "booth/skeleton_v2"), 0);
}

/// A booth of the next release: everything of this one, and the new topic beside the old.
struct NextBooth {
  drivers::SystemClock clock;
  DdsLink link{loopback("b"), clock, [](daemon::DdsCommand) { return daemon::DdsAnswer{}; }};
  Peer peer{"b"};
  dds_entity_t writer = peer.writer(booth_msg_SkeletonV2_desc, "booth/skeleton_v2");
  void publish() {
    link.publish_idle(0);
    booth_msg_SkeletonV2 s{};
    std::strcpy(s.booth, "b");
    s.version = 2;
    s.heart_rate = 61;
    dds_write(writer, &s);
  }
};

TEST(DdsEvolution, AnOldReaderHearsANewWriter) {
  NextBooth booth;
  Peer old("b");
  const dds_entity_t reader = old.reader(booth_msg_Skeleton_desc, "booth/skeleton", false);
  bool heard = false;
  for (int i = 0; i < 200 && !heard; ++i) {
    booth.publish();
    heard = take<booth_msg_Skeleton>(
        reader, [](const booth_msg_Skeleton& s) { EXPECT_EQ(s.version, 1u); }, 50ms);
  }
  EXPECT_TRUE(heard);
}

TEST(DdsEvolution, ANewReaderHearsNewWritersAndOldOnes) {
  Peer reader("b");
  const dds_entity_t v1 = reader.reader(booth_msg_Skeleton_desc, "booth/skeleton", false);
  const dds_entity_t v2 = reader.reader(booth_msg_SkeletonV2_desc, "booth/skeleton_v2", false);
  {
    NextBooth booth;
    bool heard = false;
    for (int i = 0; i < 200 && !heard; ++i) {
      booth.publish();
      heard = take<booth_msg_SkeletonV2>(
          v2, [](const booth_msg_SkeletonV2& s) { EXPECT_EQ(s.heart_rate, 61); }, 50ms);
    }
    EXPECT_TRUE(heard);
  }
  take<booth_msg_Skeleton>(
      v1, [](const auto&) {}, 0ms);
  drivers::SystemClock clock;
  DdsLink old(loopback("b"), clock, [](daemon::DdsCommand) { return daemon::DdsAnswer{}; });
  bool heard = false;
  for (int i = 0; i < 200 && !heard; ++i) {
    old.publish_idle(0);
    heard = take<booth_msg_Skeleton>(
        v1, [](const booth_msg_Skeleton& s) { EXPECT_EQ(s.version, 1u); }, 50ms);
  }
  EXPECT_TRUE(heard) << "a reader of both topics hears a booth of the last release on the old one";
  EXPECT_FALSE(take<booth_msg_SkeletonV2>(
      v2, [](const auto&) {}, 0ms));
}

TEST(DdsEvolution, AChangedTypeOnAnOldTopicIsNotTakenForTheOldOne) {
  Peer rule_breaker("b"), old("b");
  const dds_entity_t reader = old.reader(booth_msg_Skeleton_desc, "booth/skeleton", false);
  const dds_entity_t bad = rule_breaker.writer(booth_msg_SkeletonV2_desc, "booth/skeleton");
  const dds_entity_t good = rule_breaker.writer(booth_msg_Skeleton_desc, "booth/skeleton");
  for (int i = 0; i < 4000 && !has_reader(good); ++i) std::this_thread::sleep_for(5ms);
  ASSERT_TRUE(has_reader(good));
  EXPECT_FALSE(has_reader(bad)) << "types of other names do not match";
  booth_msg_SkeletonV2 s{};
  std::strcpy(s.booth, "b");
  dds_write(bad, &s);
  EXPECT_FALSE(take<booth_msg_Skeleton>(
      reader, [](const auto&) {}, 300ms));
}

}  // namespace
}  // namespace booth::tests

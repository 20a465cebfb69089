// A node of ROS 2 as tests play it: readers of all of a booth's topics, and the patience to meet the booth first.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string>

#include "daemon/dds/dds_link.hpp"
#include "daemon/dds/ros2/ros2_topics.hpp"
#include "ros2_messages.h"
#include "tests/daemon/dds/peer.hpp"
#include "tests/daemon/dds/ros2/expectations.hpp"
#include "tests/daemon/dds/ros2/ros_json.hpp"
#include "tests/daemon/support/fake_booth.hpp"

namespace booth::tests {

/// Readers of all six topics as a node would make them: in no partition, reliable, the static frames transient local.
struct Node {
  using Ros2Topic = daemon::Ros2Topic;

  Peer peer{""};
  std::array<dds_entity_t, daemon::kRos2Topics> readers{};

  explicit Node(const std::string& booth, const std::string& name_space = "") {
    const daemon::RosNames names(booth, name_space);
    for (int t = 0; t < daemon::kRos2Topics; ++t) {
      const auto topic = static_cast<Ros2Topic>(t);
      const auto& info = daemon::ros2_topic_info(topic);
      readers[static_cast<std::size_t>(t)] = peer.reader(*info.type, ("rt" + daemon::ros2_topic_name(topic, names)).c_str(), true, info.latched, 10);
    }
  }
  dds_entity_t reader(Ros2Topic topic) const { return readers[static_cast<std::size_t>(topic)]; }
  bool matched() const {
    return eventually([&] { return std::all_of(readers.begin(), readers.end(), has_writer); }, std::chrono::seconds(60));
  }
  template <class T>
  std::optional<Json> hear(Ros2Topic topic, std::chrono::milliseconds limit = std::chrono::seconds(20)) {
    std::optional<Json> out;
    take<T>(
        reader(topic), [&](const T& m) { out = ros_json(m); }, limit);
    return out;
  }
  /// Volatile writers send nothing to whom they have not met: frames are said until one has come on every topic. Afterwards nobody is there, and nothing
  /// waits to be read but the static frames.
  void meet(daemon::DdsLink& link) {
    std::array<bool, daemon::kRos2Topics> heard{};
    heard[static_cast<std::size_t>(Ros2Topic::tf_static)] = true;
    const fit::Cloud cloud = numbered_cloud(1);
    std::uint64_t n = 1'000'000;
    ASSERT_TRUE(eventually(
        [&] {
          const daemon::FrameRecord frame = posed_frame(n += 10);
          link.offer_cloud(cloud, frame.captured_ns);
          link.publish(frame);
          std::this_thread::sleep_for(std::chrono::milliseconds(10));
          link.publish_idle(0);  // so that somebody comes and goes each time, and that is said
          std::this_thread::sleep_for(std::chrono::milliseconds(10));
          for (std::size_t t = 0; t < heard.size(); ++t) heard[t] = heard[t] || drain(static_cast<Ros2Topic>(t));
          return std::all_of(heard.begin(), heard.end(), [](bool h) { return h; });
        },
        std::chrono::seconds(60)));
    // The last that was said is that nobody is there: until it has been, and all else that was under way is there, too.
    for (int quiet = 0; quiet < 6; ++quiet) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      for (std::size_t t = 0; t < heard.size(); ++t)
        if (drain(static_cast<Ros2Topic>(t))) quiet = 0;
    }
  }

 private:
  /// True when there was something; the static frames are left.
  bool drain(Ros2Topic topic) {
    bool any = false;
    void* samples[1] = {nullptr};
    dds_sample_info_t info[1];
    while (topic != Ros2Topic::tf_static && dds_take(reader(topic), samples, info, 1, 1) == 1) {
      any = any || info[0].valid_data;
      (void)dds_return_loan(reader(topic), samples, 1);
      samples[0] = nullptr;
    }
    return any;
  }
};

}  // namespace booth::tests

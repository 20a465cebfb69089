// A visitor's minute, tried as a whole: press, stand, move, press; and then what the light did, what DDS said, and what files are there.
#include <dds/dds.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "booth.h"
#include "daemon/ctl/control_client.hpp"
#include "daemon/dds/dds_link.hpp"
#include "tests/daemon/support/program.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using tests::eventually;
using tests::Program;
using tests::read_text;

constexpr std::uint32_t kDomain = 79;

/// Another machine on the network that listens to everything and writes it down.
class Listener {
 public:
  Listener() {
    // As boothd in this test: the loopback interface alone, no multicast.
    const DdsSettings settings{.booth = "visit", .domain = kDomain, .interface = "lo", .multicast = false, .peers = {}};
    domain_ = dds_create_domain(kDomain, dds_configuration(settings).c_str());
    participant_ = dds_create_participant(kDomain, nullptr, nullptr);
    dds_qos_t* qos = dds_create_qos();
    const char* partition = "visit";
    dds_qset_partition(qos, 1, &partition);
    subscriber_ = dds_create_subscriber(participant_, qos, nullptr);
    dds_delete_qos(qos);
    events_ = reader(booth_msg_Event_desc, "booth/event", true, false);
    status_ = reader(booth_msg_Status_desc, "booth/status", true, true);
    body_ = reader(booth_msg_Body_desc, "booth/body", true, true);
    skeleton_ = reader(booth_msg_Skeleton_desc, "booth/skeleton", false, false);
    thread_ = std::thread([this] {
      while (!stop_) {
        listen();
        std::this_thread::sleep_for(5ms);
      }
    });
  }
  ~Listener() {
    stop_ = true;
    thread_.join();
    dds_delete(participant_);
    dds_delete(domain_);
  }

  struct Heard {
    std::vector<std::string> events;
    std::set<std::string> bodies;               ///< sessions
    std::map<int, int> skeletons;               ///< how many of each state
    double lowest_hand = 10, highest_hand = 0;  ///< of tracked skeletons, metres above the floor
    int states = 0;
    booth_msg_SessionState last_state{};
    std::string last_alarm;
  };
  Heard heard() const {
    const std::lock_guard lock(mutex_);
    return heard_;
  }

 private:
  dds_entity_t reader(const dds_topic_descriptor_t& type, const char* topic, bool reliable, bool transient) {
    dds_qos_t* qos = dds_create_qos();
    dds_qset_reliability(qos, reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, DDS_SECS(1));
    if (transient) dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1000);
    const dds_entity_t out = dds_create_reader(subscriber_, dds_create_topic(participant_, &type, topic, nullptr, nullptr), qos, nullptr);
    dds_delete_qos(qos);
    return out;
  }
  template <class T, class F>
  void drain(dds_entity_t from, F look) {
    void* samples[1] = {nullptr};
    dds_sample_info_t info[1];
    while (dds_take(from, samples, info, 1, 1) == 1) {
      if (info[0].valid_data) look(*static_cast<const T*>(samples[0]));
      dds_return_loan(from, samples, 1);
    }
  }
  void listen() {
    const std::lock_guard lock(mutex_);
    drain<booth_msg_Event>(events_, [&](const booth_msg_Event& e) { heard_.events.push_back(std::string(e.kind) + " " + e.source + " " + e.text); });
    drain<booth_msg_Body>(body_, [&](const booth_msg_Body& b) { heard_.bodies.insert(b.session); });
    drain<booth_msg_Status>(status_, [&](const booth_msg_Status& s) {
      ++heard_.states;
      heard_.last_state = s.state;
      heard_.last_alarm = s.alarm;
    });
    drain<booth_msg_Skeleton>(skeleton_, [&](const booth_msg_Skeleton& s) {
      ++heard_.skeletons[s.state];
      if (s.state != booth_msg_STATE_TRACKING || s.person == booth_msg_PERSON_LOST) return;
      for (const auto& joint : s.joints) {
        heard_.lowest_hand = std::min(heard_.lowest_hand, joint.position[2]);
        heard_.highest_hand = std::max(heard_.highest_hand, joint.position[2]);
      }
    });
  }

  dds_entity_t domain_ = 0, participant_ = 0, subscriber_ = 0, events_ = 0, status_ = 0, body_ = 0, skeleton_ = 0;
  mutable std::mutex mutex_;
  Heard heard_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

struct VisitorTest : ::testing::Test {
  json ask(const json& request) {
    ControlClient client(socket);
    return json::parse(client.ask(request.dump()));
  }
  json status() { return ask({{"request", "status"}}); }
  bool reaches(const std::string& state, std::chrono::seconds limit) {
    return eventually(
        [&] {
          try {
            return status()["state"] == state;
          } catch (const std::exception&) {
            return false;
          }
        },
        limit);
  }
  void press(const std::string& button) {
    EXPECT_EQ(ask({{"request", "press"}, {"button", button}, {"down", true}})["ok"], true);
    std::this_thread::sleep_for(150ms);
    EXPECT_EQ(ask({{"request", "press"}, {"button", button}, {"down", false}})["ok"], true);
  }
  static std::int64_t now() {
    timespec t{};
    ::clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1'000'000'000LL + t.tv_nsec;
  }
  /// How often the light changed between two moments.
  static int changes(const json& lamp, std::int64_t from, std::int64_t to) {
    int out = 0;
    for (const auto& change : lamp["changes"]) out += change[0].get<std::int64_t>() >= from && change[0].get<std::int64_t>() < to;
    return out;
  }

  tests::TemporaryFolder folder;
  std::string socket = (folder.path / "c.sock").string();
  std::filesystem::path sessions = folder.path / "sessions";
};

TEST_F(VisitorTest, PressStandMovePress) {
  std::vector<std::string> arguments;
  for (const char* s : {"booth.id=visit", "gpio.chip=simulated", "session.countdown_seconds=1", "cameras.synthetic.motion=wave", "dds.interface=lo",
                        "dds.multicast=false", "dds.domain=79"})
    arguments.insert(arguments.end(), {"--set", s});
  arguments.insert(arguments.end(), {"--set", "control.socket=" + socket, "--set", "session.directory=" + sessions.string()});
  Program boothd("boothd", arguments, folder.path / "boothd.log");
  ASSERT_TRUE(reaches("idle", 60s)) << boothd.output();
  Listener listener;
  ASSERT_TRUE(eventually([&] { return listener.heard().states > 0; }, 20s)) << "nobody hears boothd on DDS";
  ASSERT_TRUE(eventually([&] { return ask({{"request", "lamp"}, {"lamp", "light"}})["lit"] == true; })) << "steady light: come in";

  // Press, and stand.
  const std::int64_t pressed = now();
  press("start");
  ASSERT_TRUE(reaches("tracking", 150s)) << status().dump(2) << boothd.output();
  const std::int64_t found = now();

  // Move.
  const int frames = status()["frames"].get<int>();
  ASSERT_TRUE(eventually([&] { return status()["frames"].get<int>() >= frames + 15; }, 150s)) << status().dump(2);
  ASSERT_TRUE(reaches("tracking", 60s)) << "a person who is there is found again";

  // Press.
  const std::filesystem::path session = status()["session_folder"].get<std::string>();
  const std::string id = status()["session"].get<std::string>();
  const std::int64_t left = now();
  press("start");
  ASSERT_TRUE(reaches("idle", 60s)) << status().dump(2) << boothd.output();
  ASSERT_TRUE(eventually([&] { return status()["panel"]["light"] == "steady"; })) << status().dump(2);

  // What the light did.
  const json light = ask({{"request", "lamp"}, {"lamp", "light"}}), buzzer = ask({{"request", "lamp"}, {"lamp", "buzzer"}});
  EXPECT_EQ(changes(light, 0, pressed), 1) << "it was lit when boothd was ready, and stayed so";
  EXPECT_GE(changes(light, pressed, found), 4) << "it blinked while a body was looked for";
  EXPECT_TRUE(eventually([&] { return ask({{"request", "lamp"}, {"lamp", "light"}})["lit"] == true; }));
  EXPECT_GE(changes(buzzer, pressed, found), 2) << "the press was heard";
  EXPECT_GE(changes(buzzer, left, now()), 1) << "and the end";
  EXPECT_TRUE(eventually([&] { return ask({{"request", "lamp"}, {"lamp", "buzzer"}})["lit"] == false; }));
  const json panel = status()["panel"];
  EXPECT_EQ(panel["problems"], json::array());
  EXPECT_EQ(panel["flicker"], false) << status().dump(2);

  // What DDS said.
  ASSERT_TRUE(eventually([&] { return listener.heard().last_state == booth_msg_STATE_IDLE; }));
  const Listener::Heard heard = listener.heard();
  EXPECT_THAT(heard.events, IsSupersetOf({"trigger gpio toggle", "state gpio idle -> countdown (toggle)", "state time countdown -> estimating (countdown_over)",
                                          "state fit estimating -> tracking (body_accepted)", "state gpio tracking -> finishing (toggle)",
                                          "state session finishing -> idle (files_written)"}));
  EXPECT_EQ(heard.bodies.count(id), 1u) << "this visitor's body was published";
  EXPECT_EQ(heard.last_alarm, "");
  EXPECT_GE(heard.skeletons.at(booth_msg_STATE_IDLE), 1);
  EXPECT_GE(heard.skeletons.at(booth_msg_STATE_TRACKING), 5);
  EXPECT_LT(heard.lowest_hand, 0.2) << "feet are near the floor";
  EXPECT_GT(heard.highest_hand, 1.3) << "and the head is not";

  // What files are there.
  const json j = json::parse(read_text(session / "session.json"));
  EXPECT_EQ(j["id"], id);
  EXPECT_EQ(j["result"], "complete");
  EXPECT_EQ(j["reason"], "toggle");
  EXPECT_GE(j["frames"].get<int>(), 15);
  EXPECT_EQ(j["events"][0]["text"], "toggle");
  EXPECT_EQ(j["events"][0]["source"], "gpio");
  EXPECT_LT(j["truth"]["joint_mean"].get<double>(), 0.05) << "the synthetic driver's figure is 7 to 10 mm; this is to catch a mirrored or shifted picture";
  for (const char* file : {"skeleton.csv", "skeleton.bvh", "body.ply"}) EXPECT_GT(std::filesystem::file_size(session / file), 1000u) << file;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(sessions))
    EXPECT_THAT(entry.path().filename().string(), ::testing::Not(HasSubstr(".part"))) << "something was left half done";

  // And the emergency stop, with nobody there.
  ask({{"request", "press"}, {"button", "emergency_stop"}, {"down", true}});
  ASSERT_TRUE(eventually([&] { return status()["panel"]["fault_code"] == 1; }));
  press("start");
  EXPECT_TRUE(eventually([&] {
    const auto events = listener.heard().events;
    return std::find(events.begin(), events.end(), "trigger gpio toggle refused: the emergency stop is pressed; release it first") != events.end();
  }));
  EXPECT_EQ(status()["state"], "idle");
  ask({{"request", "press"}, {"button", "emergency_stop"}, {"down", false}});
  EXPECT_TRUE(eventually([&] { return status()["panel"]["light"] == "steady"; }));

  boothd.signal(SIGTERM);
  EXPECT_EQ(boothd.wait(), 0) << boothd.output();
}

}  // namespace
}  // namespace booth::daemon

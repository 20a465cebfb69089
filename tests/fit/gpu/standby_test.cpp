// The device while it works, a substitute otherwise: who computes, what is told, when it is tried again.
#include "fit/gpu/standby.hpp"

#include <gtest/gtest.h>

namespace booth::gpu {
namespace {

using namespace std::chrono_literals;

struct Worker {
  explicit Worker(std::atomic<int>& count) : alive(count) { ++alive; }
  ~Worker() { --alive; }
  const char* name() const { return "device test"; }
  std::atomic<int>& alive;
};

struct Scene {
  std::atomic<bool> there{true};
  std::atomic<int> starts{0}, alive{0};
  std::unique_ptr<Standby<Worker>> standby;

  explicit Scene(GuardSettings settings, bool there_at_first = true) : there(there_at_first) {
    standby = std::make_unique<Standby<Worker>>(
        "cpu",
        [this](std::string& why) -> std::unique_ptr<Worker> {
          ++starts;
          if (there) return std::make_unique<Worker>(alive);
          why = "no device";
          return nullptr;
        },
        settings);
  }
  bool comes_back() {
    const auto limit = std::chrono::steady_clock::now() + 60s;
    while (!standby->take() && std::chrono::steady_clock::now() < limit) std::this_thread::sleep_for(1ms);
    return standby->current() != nullptr;
  }
};

TEST(Standby, HasTheDeviceFromTheStart) {
  Scene scene({1h, 1h});
  EXPECT_NE(scene.standby->current(), nullptr);
  const DeviceReport r = scene.standby->report();
  EXPECT_TRUE(r.wanted && r.used);
  EXPECT_EQ(r.name, "device test");
  EXPECT_EQ(r.problem, "");
  EXPECT_EQ(r.changes, 0u);
}

TEST(Standby, SaysWhyItWasLostAndTakesItBack) {
  Scene scene({1ms, 4ms});
  scene.there = false;
  scene.standby->lose("the device was lost");
  EXPECT_EQ(scene.standby->current(), nullptr);
  DeviceReport r = scene.standby->report();
  EXPECT_FALSE(r.used);
  EXPECT_EQ(r.name, "cpu");
  EXPECT_EQ(r.losses, 1u);
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while (scene.starts < 3 && std::chrono::steady_clock::now() < limit) std::this_thread::sleep_for(1ms);
  EXPECT_EQ(scene.alive, 0) << "the lost one was taken apart";
  scene.there = true;
  ASSERT_TRUE(scene.comes_back());
  r = scene.standby->report();
  EXPECT_TRUE(r.used);
  EXPECT_EQ(r.problem, "");
  EXPECT_EQ(r.changes, 2u);
  scene.standby.reset();
  EXPECT_EQ(scene.alive, 0);
}

TEST(Standby, TellsTheReason) {
  Scene scene({1h, 1h});
  scene.standby->lose("out of device memory");
  EXPECT_EQ(scene.standby->report().problem, "the device failed in mid-run (out of device memory); the CPU has taken over");
}

TEST(Standby, FindsADeviceThatWasNotThereAtTheStart) {
  Scene scene({1ms, 4ms}, false);
  EXPECT_EQ(scene.standby->current(), nullptr);
  EXPECT_EQ(scene.standby->report().problem, "no device");
  scene.there = true;
  EXPECT_TRUE(scene.comes_back());
  EXPECT_EQ(scene.standby->report().losses, 0u);
}

TEST(Standby, IsTakenApartWhileItWaits) {
  Scene scene({1h, 1h}, false);
  scene.standby.reset();
  EXPECT_EQ(scene.starts, 1);
}

}  // namespace
}  // namespace booth::gpu

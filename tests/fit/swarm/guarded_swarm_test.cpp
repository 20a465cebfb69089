// A device that is lost in mid-run, one that comes back, one that never was: the frames go on, and the report says what happened.
#include "fit/swarm/guarded_swarm.hpp"

#include <gtest/gtest.h>

#include <thread>

#include "fit/swarm/device/device_swarm.hpp"
#include "fit/swarm/device/emulated_device.hpp"
#include "tests/support/capsule_body.hpp"
#include "tests/support/plain_prior.hpp"
#include "tests/support/posed_cloud.hpp"

namespace booth::fit {
namespace {

using namespace std::chrono_literals;
using device::Faults;

struct Scene {
  std::shared_ptr<const BodyModel> model = tests::capsule_body();
  std::shared_ptr<const PosePrior> prior = tests::plain_prior();
  Observation observation = tests::posed_cloud(*model, ShapeVector::Zero(model->shape_count()), tests::pose_with({{"lhumerus_rz", 30}}), 0.003f, 4);
  SwarmSizes sizes{.swarm = {.particles = 20, .iterations = 2}, .energy = {.vertices = 64}, .field = {.max_points = 20000}};
  WorkerPool pool{1};
  std::vector<float> centre, deviation;
  Faults faults;
  bool refuse = false;
  std::unique_ptr<GuardedSwarm> swarm;
  SwarmResult result;
  std::uint64_t frame = 0;

  explicit Scene(GuardSettings settings = {.first_wait = 1ms, .longest_wait = 4ms}) {
    const BodyModel* one = model.get();
    auto cpu = make_cpu_swarm({&one, 1}, *prior, sizes, pool);
    centre.assign(static_cast<std::size_t>(cpu->dimensions(0)), 0);
    deviation.assign(centre.size(), 0.2f);
    start(std::move(cpu), settings);
  }
  void start(std::unique_ptr<SwarmBackend> cpu, GuardSettings settings) {
    swarm = make_guarded_swarm(
        std::move(cpu),
        [this](std::string& why) -> std::unique_ptr<SwarmBackend> {
          const BodyModel* one = model.get();
          try {
            return device::make_device_swarm(device::make_emulated_device(faults), {&one, 1}, *prior, sizes);
          } catch (const std::exception& e) {
            why = e.what();
            return nullptr;
          }
        },
        settings);
  }
  /// One frame; true when it has an answer.
  bool step() {
    return swarm->set_cloud(observation.cloud) && swarm->minimise(0, centre, deviation, {1, frame++}, result) && result.cost > 0 &&
           result.best.size() == centre.size();
  }
};

TEST(GuardedSwarm, UsesTheDeviceFromTheFirstFrameOn) {
  Scene scene;
  EXPECT_TRUE(scene.step());
  const DeviceReport r = scene.swarm->report();
  EXPECT_TRUE(r.wanted && r.used);
  EXPECT_EQ(r.name, "device emulated");
  EXPECT_EQ(r.problem, "");
  EXPECT_EQ(r.losses, 0u);
}

TEST(GuardedSwarm, TheCpuTakesOverInTheFrameThatLosesTheDevice) {
  // The driver is reset; it hangs; the device is removed; it has no memory.
  using device::DeviceError;
  for (const DeviceError error : {DeviceError::lost, DeviceError::late, DeviceError::absent, DeviceError::out_of_memory}) {
    Scene scene({.first_wait = 1h, .longest_wait = 1h});
    EXPECT_TRUE(scene.step());
    scene.faults.error = error;
    scene.faults.runs_left = 0;
    EXPECT_TRUE(scene.step());  // this very frame
    DeviceReport r = scene.swarm->report();
    EXPECT_FALSE(r.used);
    EXPECT_EQ(r.losses, 1u);
    EXPECT_EQ(r.changes, 1u);
    EXPECT_NE(r.problem.find(to_string(error)), std::string::npos) << r.problem;
    EXPECT_EQ(r.name.substr(0, 3), "cpu");
    // What it answers is the CPU's own answer.
    const float cost = scene.result.cost;
    WorkerPool pool(1);
    const BodyModel* one = scene.model.get();
    auto cpu = make_cpu_swarm({&one, 1}, *scene.prior, scene.sizes, pool);
    SwarmResult alone;
    ASSERT_TRUE(cpu->set_cloud(scene.observation.cloud));
    ASSERT_TRUE(cpu->minimise(0, scene.centre, scene.deviation, {1, scene.frame - 1}, alone));
    EXPECT_EQ(cost, alone.cost);
    EXPECT_TRUE(scene.step());
  }
}

TEST(GuardedSwarm, TriesALostDeviceAgainAndUsesItWhenItIsBack) {
  Scene scene;
  scene.faults.runs_left = 1;
  EXPECT_TRUE(scene.step());
  EXPECT_TRUE(scene.step());  // lost here
  EXPECT_FALSE(scene.swarm->report().used);
  scene.faults.runs_left = -1;
  for (int i = 0; i < 5000 && !scene.swarm->report().used; ++i) {
    std::this_thread::sleep_for(1ms);
    ASSERT_TRUE(scene.step());
  }
  const DeviceReport r = scene.swarm->report();
  EXPECT_TRUE(r.used);
  EXPECT_EQ(r.changes, 2u);
  EXPECT_GE(scene.faults.starts, 2);
}

// A camera's decoder loses the device and resets it: the swarm's memory went with the reset.
TEST(GuardedSwarm, NoticesThatSomebodyElseResetTheDevice) {
  Scene scene({.first_wait = 1h, .longest_wait = 1h});
  EXPECT_TRUE(scene.step());
  scene.faults.gate.lose(0);
  const auto another = device::make_emulated_device(scene.faults);
  EXPECT_TRUE(scene.step());
  EXPECT_EQ(scene.swarm->report().losses, 1u);
  EXPECT_FALSE(scene.swarm->report().used);
}

TEST(GuardedSwarm, StartsOnTheCpuWhereTheDeviceHasNoMemory) {
  Scene scene({.first_wait = 1h, .longest_wait = 1h});
  scene.faults.at_start = device::DeviceError::out_of_memory;
  auto again = make_cpu_swarm(std::array{static_cast<const BodyModel*>(scene.model.get())}, *scene.prior, scene.sizes, scene.pool);
  scene.start(std::move(again), {.first_wait = 1h, .longest_wait = 1h});
  EXPECT_TRUE(scene.step());
  const DeviceReport r = scene.swarm->report();
  EXPECT_FALSE(r.used);
  EXPECT_EQ(r.losses, 0u);
  EXPECT_NE(r.problem.find("out of device memory"), std::string::npos) << r.problem;
}

TEST(GuardedSwarm, WaitsLongerAfterEveryFailedTry) {
  Scene scene({.first_wait = 20ms, .longest_wait = 10s});
  scene.faults.runs_left = 0;
  EXPECT_TRUE(scene.step());
  scene.faults.at_start = device::DeviceError::absent;
  const auto begin = std::chrono::steady_clock::now();
  std::this_thread::sleep_for(300ms);
  // 20 + 40 + 80 + ... : as many tries as fit, and one for the rounding.
  const auto passed = std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now() - begin).count() + 20;
  int most = 1;
  for (long wait = 20, sum = 20; sum <= passed; wait *= 2, sum += wait) ++most;
  EXPECT_LE(scene.swarm->report().attempts, static_cast<std::uint64_t>(most + 1));
}

}  // namespace
}  // namespace booth::fit

// The device's kernels, emulated: the same bits as the CPU's functions over the same field, whatever the order of threads; an exact field.
#include "fit/swarm/device/device_swarm.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "fit/swarm/device/emulated_device.hpp"
#include "fit/swarm/lanes.hpp"
#include "fit/swarm/swarm_group.hpp"
#include "tests/fit/swarm/swarm_scene.hpp"
#include "tests/support/allocation_count.hpp"

namespace booth::fit {
namespace {

using device::Faults;
using device::Order;

struct Scene : tests::SwarmScene {
  Scene() : SwarmScene(101, 4, 640) {}
  std::unique_ptr<device::DeviceSwarm> make(Faults& faults, int processors = 8) const {
    const BodyModel* one = model.get();
    return device::make_device_swarm(device::make_emulated_device(faults, processors), {&one, 1}, *prior, sizes);
  }
};

/// The CPU's scalar kernel over the field that the device built.
std::vector<float> reference(const Scene& scene, const BrickView& field, const RandomKey& key, float& cost, std::vector<float>& history) {
  const EnergyPack pack(*scene.model, *scene.prior, scene.sizes.energy);
  const SwarmSettings& s = scene.sizes.swarm;
  const int d = pack.dimensions(), groups = (s.particles + kGroup - 1) / kGroup;
  std::vector<float> x(static_cast<std::size_t>(groups * d * kGroup)), v(x), best(x), best_cost(static_cast<std::size_t>(groups * kGroup)),
      global(static_cast<std::size_t>(d));
  SwarmWorkOver<BrickView> work{{pack.view()}, field,    {},       scene.centre.data(), scene.deviation.data(),
                                global.data(), x.data(), v.data(), best.data(),         best_cost.data()};
  work.step.key = key, work.step.cognitive = s.cognitive, work.step.social = s.social;
  cost = std::numeric_limits<float>::max();
  history.clear();
  for (int i = 0; i < s.iterations; ++i) {
    work.step.iteration = i, work.step.inertia = inertia_of(i, s.iterations, s.inertia_first, s.inertia_last);
    for (int g = 0; g < groups; ++g) run_reference(work, g, g + 1);
    int winner = -1;
    for (int p = 0; p < s.particles; ++p)
      if (best_cost[static_cast<std::size_t>(p)] < cost) cost = best_cost[static_cast<std::size_t>(p)], winner = p;
    for (int k = 0; k < d && winner >= 0; ++k)
      global[static_cast<std::size_t>(k)] = best[static_cast<std::size_t>((winner / kGroup * d + k) * kGroup + winner % kGroup)];
    history.push_back(cost);
  }
  return global;
}

void same_bits_as_the_cpu(const Scene& scene, int processors, Order order) {
  Faults faults;
  faults.order = order;
  const auto swarm = scene.make(faults, processors);
  SwarmResult r;
  ASSERT_TRUE(swarm->set_cloud(scene.observation.cloud));
  ASSERT_TRUE(swarm->minimise(0, scene.centre, scene.deviation, {7, 3}, r));
  float cost = 0;
  std::vector<float> history;
  const std::vector<float> best = reference(scene, *swarm->field(), {7, 3}, cost, history);
  EXPECT_EQ(r.cost, cost);
  EXPECT_EQ(std::vector<float>(r.history.begin(), r.history.end()), history);
  EXPECT_EQ(std::vector<float>(r.best.begin(), r.best.end()), best);
  EXPECT_LT(r.history.back(), r.history.front());
}

TEST(DeviceSwarm, GivesTheCpusBitsOverTheSameField) {
  same_bits_as_the_cpu(Scene(), 1, Order::forwards);   // 16 particles a block
  same_bits_as_the_cpu(Scene(), 64, Order::forwards);  // 4
}

// A missing barrier, or a block that reads what another one writes, shows as a difference between the two orders.
TEST(DeviceSwarm, DoesNotDependOnTheOrderOfThreadsAndBlocks) {
  same_bits_as_the_cpu(Scene(), 1, Order::backwards);
  same_bits_as_the_cpu(Scene(), 64, Order::backwards);
}

TEST(DeviceSwarm, EvaluatesAnyParticleAndTheBestOneWithoutAnotherRun) {
  const Scene scene;
  Faults faults;
  const auto swarm = scene.make(faults);
  const EnergyPack pack(*scene.model, *scene.prior, scene.sizes.energy);
  ASSERT_TRUE(swarm->set_cloud(scene.observation.cloud));
  const auto expect_terms = [&](std::span<const float> particle, const ParticleTerms& t) {
    LaneTerms<ScalarLanes> r;
    particle_energy<ScalarLanes, 0>(pack.view(), *swarm->field(), particle.data(), 1, r);
    EXPECT_EQ(t.point, r.point);
    EXPECT_EQ(t.plane, r.plane);
    EXPECT_EQ(t.shape, r.shape);
    EXPECT_EQ(t.bone, r.bone);
    EXPECT_EQ(t.pose, r.pose);
  };
  ParticleTerms terms{};
  ASSERT_TRUE(swarm->evaluate(0, scene.centre, terms));
  expect_terms(scene.centre, terms);
  SwarmResult r;
  ASSERT_TRUE(swarm->minimise(0, scene.centre, scene.deviation, {1, 1}, r));
  faults.runs_left = 0;
  ASSERT_TRUE(swarm->evaluate(0, r.best, terms));
  expect_terms(r.best, terms);
}

TEST(DeviceSwarm, BuildsAnExactField) {
  const Scene scene;
  Faults faults;
  const auto swarm = scene.make(faults);
  const Cloud& cloud = scene.observation.cloud;
  ASSERT_TRUE(swarm->set_cloud(cloud));
  ParticleTerms terms{};
  ASSERT_TRUE(swarm->evaluate(0, scene.centre, terms));
  const BrickView& f = *swarm->field();
  std::mt19937 random(1);
  std::uniform_int_distribution<int> pick(0, cloud.size - 1);
  std::normal_distribution<float> gauss(0, 0.1f);
  double error = 0;
  int count = 0;
  for (int i = 0; i < 3000; ++i) {
    const auto k = static_cast<std::size_t>(pick(random));
    const Eigen::Vector3f p(cloud.x[k] + gauss(random), cloud.y[k] + gauss(random), cloud.z[k] + gauss(random));
    float nearest = 1e9f;
    for (std::size_t j = 0; j < static_cast<std::size_t>(cloud.size); ++j)
      nearest = std::min(nearest, (Eigen::Vector3f(cloud.x[j], cloud.y[j], cloud.z[j]) - p).norm());
    Eigen::Vector3f d = (p - Eigen::Vector3f(f.origin[0], f.origin[1], f.origin[2])) * f.inverse_cell;
    const bool outside = field_difference<ScalarLanes>(f, d[0], d[1], d[2]);
    ASSERT_FALSE(outside && nearest < 0.29f);
    if (outside) continue;
    const float found = d.norm() * f.cell_size;
    EXPECT_GT(found, nearest - 0.0015f);                      // half a step of an offset along each axis
    EXPECT_LT(found, nearest + 2.61f * 0.0125f * 2 + 0.06f);  // never worse than a far brick's answer
    error += static_cast<double>(found - nearest), ++count;
  }
  ASSERT_GT(count, 2000);
  EXPECT_LT(error / count, 0.0015);
}

/// Every brick's entry and every cell that answers, in their order.
std::vector<std::int32_t> field_values(const Scene& scene, Order order) {
  Faults faults;
  faults.order = order;
  const auto swarm = scene.make(faults);
  ParticleTerms terms{};
  EXPECT_TRUE(swarm->set_cloud(scene.observation.cloud) && swarm->evaluate(0, scene.centre, terms));
  const BrickView& f = *swarm->field();
  std::vector<std::int32_t> out;
  const int layer = f.brick_strides >> 16, bricks = layer * static_cast<int>((f.last[2] + 0.5f) / kBrick);
  for (int b = 0; b < bricks; ++b) {
    out.push_back(f.brick[b]);
    for (int c = 0; c < (f.brick[b] < 0 ? 1 : kBrickCells); ++c) out.push_back(f.cell[(f.brick[b] < 0 ? ~f.brick[b] : f.brick[b]) + c]);
  }
  return out;
}

TEST(DeviceSwarm, BuildsTheSameFieldInAnyOrder) {
  const Scene scene;
  const auto a = field_values(scene, Order::forwards), b = field_values(scene, Order::backwards);
  ASSERT_EQ(a.size(), b.size());
  int different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) different += a[i] != b[i];
  EXPECT_EQ(different, 0) << "of " << a.size();
}

TEST(DeviceSwarm, TakesCloudsThatHoldNothing) {
  const Scene scene;
  Faults faults;
  const auto swarm = scene.make(faults);
  Cloud cloud(10);
  SwarmResult r;
  ASSERT_TRUE(swarm->set_cloud(cloud));
  ASSERT_TRUE(swarm->minimise(0, scene.centre, scene.deviation, {1, 1}, r));
  const float nothing = std::numeric_limits<float>::quiet_NaN();
  cloud.push({nothing, 0, 0}, {0, 0, 1}, 0);
  cloud.push({0, 1e30f, 0}, {0, 0, 1}, 0);
  ASSERT_TRUE(swarm->set_cloud(cloud));
  ASSERT_TRUE(swarm->minimise(0, scene.centre, scene.deviation, {1, 2}, r));
  EXPECT_TRUE(std::isfinite(r.cost));
}

TEST(DeviceSwarm, AllocatesNothingInAFrame) {
  const Scene scene;
  Faults faults;
  const auto swarm = scene.make(faults);
  SwarmResult r;
  if (!tests::AllocationCount::supported()) GTEST_SKIP() << "the sanitizers bring their own allocator";
  const tests::AllocationCount allocations;
  for (std::uint64_t frame = 0; frame < 2; ++frame) {
    ASSERT_TRUE(swarm->set_cloud(scene.observation.cloud));
    ASSERT_TRUE(swarm->minimise(0, scene.centre, scene.deviation, {1, frame}, r));
  }
  EXPECT_EQ(allocations.so_far(), 0u);
}

TEST(DeviceSwarm, SaysWhenTheDeviceIsLost) {
  const Scene scene;
  Faults faults;
  const auto swarm = scene.make(faults);
  SwarmResult r;
  ASSERT_TRUE(swarm->set_cloud(scene.observation.cloud));
  faults.runs_left = 0;
  EXPECT_FALSE(swarm->minimise(0, scene.centre, scene.deviation, {1, 1}, r));
  EXPECT_EQ(swarm->error(), device::DeviceError::lost);
  EXPECT_FALSE(swarm->set_cloud(scene.observation.cloud));
}

TEST(DeviceSwarm, RefusesToStartWithoutMemory) {
  const Scene scene;
  Faults faults;
  faults.allocations_left = 5;
  EXPECT_THROW(scene.make(faults), std::runtime_error);
}

}  // namespace
}  // namespace booth::fit

// The vector kernels against the scalar reference, particle by particle, and each against itself compiled without optimisation.
#include "fit/swarm/swarm_kernel.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "fit/swarm/lanes.hpp"
#include "tests/fit/swarm/swarm_scene.hpp"

namespace booth::fit {

// kernel_vector.cpp once more, compiled as a debug build would.
SwarmKernelFunction run_debug_baseline;
#if defined(__x86_64__)
SwarmKernelFunction run_debug_avx2, run_debug_avx512;
#endif

namespace {

using tests::SwarmScene;

/// What one kernel makes of 16 groups: positions, the best of each particle and its cost, after some iterations about a common best.
struct Outcome {
  std::vector<float> position, velocity, best, cost;
};

Outcome run_groups_of(const SwarmScene& scene, SwarmKernelFunction* kernel, int iterations) {
  WorkerPool pool(1);
  CellField field(scene.sizes.field);
  field.rebuild(scene.observation.cloud, pool);
  const EnergyPack pack(*scene.model, *scene.prior, scene.sizes.energy);
  constexpr int kGroups = 16;
  const int d = pack.dimensions();
  Outcome r;
  for (auto* v : {&r.position, &r.velocity, &r.best}) v->assign(static_cast<std::size_t>(kGroups * d * kGroup), 0);
  r.cost.assign(kGroups * kGroup, 0);
  SwarmWork work{pack.batch_view(), field.view(),  {},           scene.centre.data(), scene.deviation.data(), scene.centre.data(), r.position.data(),
                 r.velocity.data(), r.best.data(), r.cost.data()};
  work.step.key = {11, 3}, work.step.cognitive = work.step.social = 1.49f;
  for (int i = 0; i < iterations; ++i) {
    work.step.iteration = i, work.step.inertia = inertia_of(i, iterations, 0.9f, 0.4f);
    for (int g = 0; g < kGroups; g += kMostGroups) kernel(work, g, g + kMostGroups);
  }
  return r;
}

/// Largest and mean relative difference of the costs, where the particles are the same.
void compare(const Outcome& a, const Outcome& b, double& largest, double& mean) {
  ASSERT_EQ(a.position, b.position) << "the move has no rounding of its own";
  largest = mean = 0;
  for (std::size_t i = 0; i < a.cost.size(); ++i) {
    const double e = std::abs(static_cast<double>(a.cost[i] - b.cost[i])) / static_cast<double>(b.cost[i]);
    largest = std::max(largest, e), mean += e / static_cast<double>(a.cost.size());
  }
}

class Bodies : public testing::TestWithParam<int> {
 protected:
  SwarmScene scene{333, 10, 512, GetParam() == 15 ? tests::fifteen_shapes() : tests::capsule_body()};
};

TEST_P(Bodies, EveryKernelIsTheReferenceButForItsRoundingsParticleByParticle) {
  ASSERT_EQ(scene.model->shape_count(), GetParam());
  int count = 0;
  const SwarmKernel* all = swarm_kernels(count);
  const Outcome reference = run_groups_of(scene, all[0].run, 1);
  for (int k = 1; k < count; ++k) {
    if (!all[k].available()) continue;
    double largest = 0, mean = 0;
    compare(run_groups_of(scene, all[k].run, 1), reference, largest, mean);
    // Small weights left out and bytes instead of halves; of fifteen coefficients, which here turn every normal, three leave the normals alone.
    EXPECT_LT(largest, GetParam() == 15 ? 1.5e-2 : 8e-3) << all[k].name;
    EXPECT_LT(mean, GetParam() == 15 ? 3e-3 : 1e-3) << all[k].name;
    RecordProperty(std::string(all[k].name) + "_largest_millionths", static_cast<int>(1e6 * largest));
  }
}

// docs/design/performance.md derives the bound: roundings of 2^-24, and now and then a vertex in the cell beside.
TEST_P(Bodies, KernelsDifferByRoundingsAndAnOddVertexInTheCellBeside) {
  int count = 0;
  const SwarmKernel* all = swarm_kernels(count);
  ASSERT_STREQ(all[1].name, "baseline");
  const Outcome baseline = run_groups_of(scene, all[1].run, 1);
  for (int k = 2; k < count; ++k) {
    if (!all[k].available()) continue;
    double largest = 0, mean = 0;
    compare(run_groups_of(scene, all[k].run, 1), baseline, largest, mean);
    EXPECT_LT(largest, 1e-3) << all[k].name;
    EXPECT_LT(mean, 2e-5) << all[k].name;
    RecordProperty(std::string(all[k].name) + "_largest_billionths", static_cast<int>(1e9 * largest));
    RecordProperty(std::string(all[k].name) + "_mean_billionths", static_cast<int>(1e9 * mean));
  }
}

TEST_P(Bodies, AKernelGivesTheSameBitsWhenItIsCompiledForDebugging) {
  const auto expect_same = [&](const char* name, SwarmKernelFunction* debug) {
    int count = 0;
    const SwarmKernel* all = swarm_kernels(count);
    for (int k = 0; k < count; ++k) {
      if (std::string(all[k].name) != name || !all[k].available()) continue;
      const Outcome a = run_groups_of(scene, all[k].run, 3), b = run_groups_of(scene, debug, 3);
      EXPECT_EQ(a.cost, b.cost) << name;
      EXPECT_EQ(a.best, b.best) << name;
      EXPECT_EQ(a.position, b.position) << name;
    }
  };
  expect_same("baseline", run_debug_baseline);
#if defined(__x86_64__)
  expect_same("avx2", run_debug_avx2);
  expect_same("avx512", run_debug_avx512);
#endif
}

INSTANTIATE_TEST_SUITE_P(Shapes, Bodies, testing::Values(tests::kCapsuleShapes, 15));

}  // namespace
}  // namespace booth::fit

// The CPU's swarm against independent references: the energy in double precision, the random numbers' definition, the generic swarm.
#include "fit/swarm/backend.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "fit/swarm/lanes.hpp"
#include "fit/swarm/random.hpp"
#include "fit/swarm/swarm_kernel.hpp"
#include "tests/fit/swarm/generic_swarm.hpp"
#include "tests/fit/swarm/reference_energy.hpp"
#include "tests/fit/swarm/swarm_scene.hpp"
#include "tests/support/allocation_count.hpp"

namespace booth::fit {
namespace {

using tests::SwarmScene;

TEST(SwarmEnergy, AgreesWithTheReferenceInDoublePrecisionTermByTerm) {
  const SwarmScene scene;
  WorkerPool pool(2);
  const auto swarm = scene.make(pool);
  ASSERT_TRUE(swarm->set_cloud(scene.observation.cloud));
  CellField field(scene.sizes.field);
  field.rebuild(scene.observation.cloud, pool);
  tests::ReferenceEnergy reference(*scene.model, *scene.prior, scene.sizes.energy.shape_count, scene.sizes.energy.vertices);
  reference.set_field(field);
  int plain = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const std::vector<float> p = scene.particle(seed);
    ParticleTerms t{};
    ASSERT_TRUE(swarm->evaluate(0, p, t));
    const tests::ReferenceEnergy::Terms r = reference.evaluate(p.data());
    // A vertex on the border of two cells may fall to either side: a few millimetres of one vertex among 512. Where the band ends the plane's
    // distance jumps to the charge: the reference says for which particles, and by how much.
    EXPECT_NEAR(static_cast<double>(t.point), r.point, 3e-4 * r.point) << seed;
    EXPECT_NEAR(static_cast<double>(t.plane), r.plane, 1e-3 * r.plane + r.plane_at_edge) << seed;
    plain += r.plane_at_edge == 0;
    EXPECT_NEAR(static_cast<double>(t.shape), r.shape, 1e-5 * r.shape) << seed;
    EXPECT_NEAR(static_cast<double>(t.bone), r.bone, 1e-3 + 1e-3 * r.bone) << seed;
    EXPECT_NEAR(static_cast<double>(t.pose), r.pose, 1e-4 + 1e-4 * r.pose) << seed;
  }
  EXPECT_GT(plain, 150) << "that many particles have no vertex there, and no allowance";
}

TEST(SwarmEnergy, ABetaBeyondSixteenDeviationsIsHeldThereAndNothingOverflows) {
  const SwarmScene scene;
  WorkerPool pool(1);
  const auto swarm = scene.make(pool);
  ASSERT_TRUE(swarm->set_cloud(scene.observation.cloud));
  std::vector<float> p = scene.centre;
  for (std::size_t k = kDofs; k < p.size(); ++k) p[k] = k % 2 ? 1e9f : -1e9f;
  ParticleTerms t{};
  ASSERT_TRUE(swarm->evaluate(0, p, t));
  EXPECT_TRUE(std::isfinite(t.point) && std::isfinite(t.plane));
  EXPECT_LE(t.point, 301e3f) << "no more than every vertex off the band";
  p[0] = std::numeric_limits<float>::quiet_NaN();
  ASSERT_TRUE(swarm->evaluate(0, p, t));
  EXPECT_NEAR(t.point, 300e3f, 100) << "a pose that is no number is off the band, not out of the table";
}

TEST(SwarmMove, DrawsTheNumbersOfRandom) {
  const std::uint64_t seed = 0x123456789abcdef0, frame = 0xfedcba9876543210;
  const Random random(seed, frame);
  for (std::uint32_t particle : {0u, 1u, 1999u, 4'000'000'000u})
    for (std::uint32_t dimension : {0u, 50u})
      for (std::uint32_t draw : {0u, 1u, 11u}) {
        std::uint32_t words[4];
        random_words<ScalarLanes>({seed, frame}, particle, dimension, draw, words);
        const auto expected = random.words(particle, dimension, draw);
        for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(words[i], expected[i]);
        EXPECT_EQ(uniform<ScalarLanes>(words[0]), Random::uniform(expected[0]));
        EXPECT_EQ(uniform_low<ScalarLanes>(words[0]), Random::low(expected[0]));
        EXPECT_EQ(uniform_high<ScalarLanes>(words[0]), Random::high(expected[0]));
        EXPECT_EQ(normal<ScalarLanes>(words), Random::normal(expected));
      }
}

TEST(SwarmBackend, FindsWhatTheGenericSwarmFindsOverTheSameEnergyBitForBit) {
  const SwarmScene scene;
  WorkerPool pool(2);
  const auto swarm = scene.make(pool, "scalar");
  ASSERT_TRUE(swarm->set_cloud(scene.observation.cloud));
  const EnergyPack pack(*scene.model, *scene.prior, scene.sizes.energy);
  Swarm reference(scene.sizes.swarm, pack.dimensions(), pool);
  const float cost = reference.minimise(scene.centre, scene.deviation, Random(7, 3), [&](int, const float* x) {
    ParticleTerms t{};
    EXPECT_TRUE(swarm->evaluate(0, {x, scene.centre.size()}, t));
    return total_energy<ScalarLanes>(pack.view(), t);
  });
  SwarmResult out;
  ASSERT_TRUE(swarm->minimise(0, scene.centre, scene.deviation, {7, 3}, out));
  EXPECT_EQ(out.cost, cost);
  EXPECT_TRUE(std::equal(out.best.begin(), out.best.end(), reference.best().begin(), reference.best().end()));
  EXPECT_TRUE(std::equal(out.history.begin(), out.history.end(), reference.history().begin(), reference.history().end()));
  EXPECT_LT(out.history.back(), 0.8f * out.history.front());
}

TEST(SwarmBackend, SameBitsForAnyNumberOfThreadsAndForAvx2AndAvx512) {
  const SwarmScene scene;
  int kernels = 0;
  const SwarmKernel* all = swarm_kernels(kernels);
  std::map<std::string, std::vector<float>> found;
  for (int k = 0; k < kernels; ++k) {
    if (!all[k].available()) continue;
    const std::string name = std::string(all[k].name).starts_with("avx") ? "avx" : all[k].name;
    for (int threads : {1, 2, 4}) {
      WorkerPool pool(threads);
      const auto swarm = scene.make(pool, all[k].name);
      ASSERT_TRUE(swarm->set_cloud(scene.observation.cloud));
      SwarmResult out;
      ASSERT_TRUE(swarm->minimise(0, scene.centre, scene.deviation, {1, 5}, out));
      std::vector<float> all_of_it(out.history.begin(), out.history.end());
      all_of_it.insert(all_of_it.end(), out.best.begin(), out.best.end());
      const auto [expected, first] = found.try_emplace(name, all_of_it);
      EXPECT_TRUE(first || expected->second == all_of_it) << all[k].name << " " << threads;
    }
  }
}

TEST(SwarmBackend, AllocatesNothingInAFrame) {
  if (!tests::AllocationCount::supported()) GTEST_SKIP() << "skipped: allocations cannot be counted in this build";
  SwarmScene scene;
  WorkerPool pool(2);
  const auto swarm = scene.make(pool);
  ASSERT_TRUE(swarm->set_cloud(scene.observation.cloud));
  SwarmResult out;
  ASSERT_TRUE(swarm->minimise(0, scene.centre, scene.deviation, {1, 1}, out));
  const tests::AllocationCount count;
  ASSERT_TRUE(swarm->set_cloud(scene.observation.cloud));
  ASSERT_TRUE(swarm->minimise(0, scene.centre, scene.deviation, {1, 2}, out));
  EXPECT_EQ(count.so_far(), 0u);
  EXPECT_GT(swarm->memory_bytes(), 1'000'000u);
}

TEST(SwarmBackend, SaysWhatIsWrong) {
  const SwarmScene scene;
  WorkerPool pool(1);
  EXPECT_THROW((void)scene.make(pool, "abacus"), std::invalid_argument);
  SwarmSizes wrong = scene.sizes;
  wrong.swarm.particles = 0;
  const BodyModel* one = scene.model.get();
  EXPECT_THROW((void)make_cpu_swarm({&one, 1}, *scene.prior, wrong, pool), std::invalid_argument);
  wrong = scene.sizes;
  wrong.energy.vertices = 3;
  EXPECT_THROW((void)make_cpu_swarm({&one, 1}, *scene.prior, wrong, pool), std::invalid_argument);
  EXPECT_THROW((void)make_cpu_swarm({}, *scene.prior, scene.sizes, pool), std::invalid_argument);
}

}  // namespace
}  // namespace booth::fit

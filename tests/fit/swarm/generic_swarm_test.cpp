// The swarm on functions whose minimum is known, and its independence of the number of threads.
#include "tests/fit/swarm/generic_swarm.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace booth::fit {
namespace {

float rosenbrock(const float* x, int n) {
  float sum = 0;
  for (int i = 0; i + 1 < n; ++i) {
    const float a = x[i + 1] - x[i] * x[i], b = 1 - x[i];
    sum += 100 * a * a + b * b;
  }
  return sum;
}

TEST(Swarm, FindsTheMinimumOfASphere) {
  WorkerPool pool(1);
  Swarm swarm({.particles = 400, .iterations = 60}, 10, pool);
  const std::vector<float> centre(10, 0.7f), deviation(10, 1.0f);
  const float cost = swarm.minimise(centre, deviation, Random(1, 1), [](int, const float* x) {
    float sum = 0;
    for (int i = 0; i < 10; ++i) sum += (x[i] - 0.1f) * (x[i] - 0.1f);
    return sum;
  });
  EXPECT_LT(cost, 0.02f);
  for (float x : swarm.best()) EXPECT_NEAR(x, 0.1f, 0.1f);
}

TEST(Swarm, NeverLosesTheStartAndItsBestNeverGetsWorse) {
  WorkerPool pool(1);
  Swarm swarm({.particles = 50, .iterations = 10}, 6, pool);
  const std::vector<float> centres = {0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1}, deviation(6, 0.5f);  // the second is Rosenbrock's minimum
  EXPECT_EQ(swarm.minimise(centres, deviation, Random(1, 1), [](int, const float* x) { return rosenbrock(x, 6); }), 0.0f);
  const std::vector<float> other(6, 0.3f);
  swarm.minimise(other, deviation, Random(1, 2), [](int, const float* x) { return rosenbrock(x, 6); });
  for (std::size_t i = 1; i < swarm.history().size(); ++i) EXPECT_LE(swarm.history()[i], swarm.history()[i - 1]);
  EXPECT_LT(swarm.history().back(), rosenbrock(other.data(), 6));
}

TEST(Swarm, SameBitsForAnyNumberOfThreads) {
  const std::vector<float> centre(12, 0.4f), deviation(12, 0.8f);
  std::vector<std::vector<float>> best;
  for (int threads : {1, 2, 4}) {
    WorkerPool pool(threads);
    Swarm swarm({.particles = 333, .iterations = 10}, 12, pool);
    swarm.minimise(centre, deviation, Random(42, 7), [](int, const float* x) { return rosenbrock(x, 12); });
    best.emplace_back(swarm.best().begin(), swarm.best().end());
  }
  EXPECT_EQ(best[0], best[1]);
  EXPECT_EQ(best[0], best[2]);
}

TEST(Swarm, AnotherSeedOrFrameIsAnotherSearch) {
  WorkerPool pool(1);
  const std::vector<float> centre(4, 0.4f), deviation(4, 0.8f);
  Swarm swarm({.particles = 20, .iterations = 3}, 4, pool);
  const auto run = [&](Random random) {
    swarm.minimise(centre, deviation, random, [](int, const float* x) { return rosenbrock(x, 4); });
    return std::vector<float>(swarm.best().begin(), swarm.best().end());
  };
  EXPECT_NE(run(Random(1, 1)), run(Random(2, 1)));
  EXPECT_NE(run(Random(1, 1)), run(Random(1, 2)));
  EXPECT_EQ(run(Random(1, 1)), run(Random(1, 1)));
}

}  // namespace
}  // namespace booth::fit

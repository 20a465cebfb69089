// The filter at rest: noise is taken off, movements are not.
#include <gtest/gtest.h>

#include <cmath>

#include "fit/track/rest_filter.hpp"

namespace booth::fit {
namespace {

/// Noise of the given size in every unknown, the same in every run.
PoseVector noisy(int frame, double size) {
  PoseVector q = PoseVector::Zero();
  for (int i = 0; i < kDofs; ++i) q[i] = size * std::sin(12.9898 * frame + 78.233 * i + 3.1 * frame * i);
  return q;
}

TEST(RestFilter, AtRestTheNoiseIsHalved) {
  RestFilter filter;
  double in = 0, out = 0;
  for (int f = 0; f < 300; ++f) {
    const PoseVector q = noisy(f, 0.007);
    const PoseVector& steady = filter.next(q);
    if (f < 30) continue;
    in += q.squaredNorm(), out += steady.squaredNorm();
  }
  EXPECT_LT(std::sqrt(out / in), 0.6);
}

TEST(RestFilter, AMovementComesThroughInItsFirstFrame) {
  RestFilter filter;
  for (int f = 0; f < 30; ++f) filter.next(noisy(f, 0.005));
  PoseVector q = PoseVector::Zero();
  q[11] = 0.05;  // 1.5 rad/s at 30 frames/s
  EXPECT_EQ(filter.next(q), q);
}

TEST(RestFilter, ACreepingMovementIsNeverFurtherBehindThanTheNoise) {
  RestFilter filter;
  PoseVector q = PoseVector::Zero();
  for (int f = 0; f < 300; ++f) {
    q[4] += 0.002;
    q[0] += 0.001;
    const PoseVector behind = q - filter.next(q);
    EXPECT_LT(behind[4], RestFilter::kNoiseTurn);
    EXPECT_LT(behind[0], RestFilter::kNoiseMove);
  }
}

TEST(RestFilter, AfterAResetThePoseIsTakenAsItIs) {
  RestFilter filter;
  filter.next(PoseVector::Zero());
  filter.reset();
  const PoseVector q = PoseVector::Constant(0.001);
  EXPECT_EQ(filter.next(q), q);
}

}  // namespace
}  // namespace booth::fit

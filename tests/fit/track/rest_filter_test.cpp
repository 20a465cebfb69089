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

TEST(RestFilter, AtRestNoiseIsTakenOff) {
  RestFilter filter;
  double in = 0, out = 0;
  for (int f = 0; f < 300; ++f) {
    const PoseVector q = noisy(f, 0.0015);
    const PoseVector& steady = filter.next(q, average_bone_vectors());
    if (f < 30) continue;
    in += q.squaredNorm(), out += steady.squaredNorm();
  }
  EXPECT_LT(std::sqrt(out / in), 0.75);
}

TEST(RestFilter, AMovementComesThroughInItsFirstFrame) {
  RestFilter filter;
  for (int f = 0; f < 30; ++f) filter.next(noisy(f, 0.002), average_bone_vectors());
  PoseVector q = PoseVector::Zero();
  q[0] = 0.02;  // 0.6 m/s at 30 frames/s
  EXPECT_EQ(filter.next(q, average_bone_vectors()), q);
  q[dof_index("head_ry")] = 0.12;  // a head that turns moves no joint
  EXPECT_EQ(filter.next(q, average_bone_vectors()), q);
}

TEST(RestFilter, ACreepingMovementIsNeverFurtherBehindThanTheNoise) {
  RestFilter filter;
  PoseVector q = PoseVector::Zero();
  for (int f = 0; f < 300; ++f) {
    q[4] += 0.002;
    q[0] += 0.001;
    const PoseVector behind = q - filter.next(q, average_bone_vectors());
    EXPECT_LT(behind[4], RestFilter::kTurn);
    EXPECT_LT(behind[0], RestFilter::kMove);
  }
}

TEST(RestFilter, AfterAResetThePoseIsTakenAsItIs) {
  RestFilter filter;
  filter.next(PoseVector::Zero(), average_bone_vectors());
  filter.reset();
  const PoseVector q = PoseVector::Constant(0.001);
  EXPECT_EQ(filter.next(q, average_bone_vectors()), q);
}

}  // namespace
}  // namespace booth::fit

// Percentiles from buckets are close to the true ones, and never below them.
#include <gtest/gtest.h>

#include "daemon/pipeline/latency_histogram.hpp"

namespace booth::daemon {
namespace {

using namespace std::chrono_literals;

TEST(LatencyHistogram, PercentilesAreWithinFivePercent) {
  LatencyHistogram histogram;
  for (int i = 1; i <= 1000; ++i) histogram.add(i * 100us);
  const LatencySummary s = histogram.summary();
  EXPECT_EQ(s.count, 1000u);
  for (const auto& [p, exact] : {std::pair{s.p50_ms, 50.0}, {s.p95_ms, 95.0}, {s.p99_ms, 99.0}}) {
    EXPECT_GE(p, exact * 0.9999);
    EXPECT_LE(p, exact * 1.051);
  }
  EXPECT_DOUBLE_EQ(s.max_ms, 100.0);
  EXPECT_NEAR(s.mean_ms, 50.05, 1e-9);
}

TEST(LatencyHistogram, ExtremesKeepTheirPlaces) {
  LatencyHistogram histogram;
  EXPECT_EQ(histogram.summary().p99_ms, 0);
  histogram.add(-5ms);
  histogram.add(10h);
  EXPECT_LE(histogram.summary().p50_ms, 0.001);
  EXPECT_DOUBLE_EQ(histogram.summary().max_ms, 36e6);
  histogram.reset();
  EXPECT_EQ(histogram.summary().count, 0u);
}

}  // namespace
}  // namespace booth::daemon

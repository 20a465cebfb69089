// Counts durations in fixed buckets, so that percentiles of hours of frames cost no memory and no lock.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "hal/time.hpp"

namespace booth::daemon {

struct LatencySummary {
  std::uint64_t count = 0;
  double p50_ms = 0, p95_ms = 0, p99_ms = 0, max_ms = 0, mean_ms = 0;
};

/// Thread-safe: add() and summary() may run at the same time; reset() while others add() loses at most their samples.
class LatencyHistogram {
 public:
  void add(hal::Nanoseconds duration);
  void reset();
  /// Percentiles are upper edges of buckets, at most 5 % above the true value and never above the largest one; max and mean are exact.
  LatencySummary summary() const;

 private:
  static constexpr int kBuckets = 384;  ///< ratio 1.05 from 1 us: up to two minutes
  static int bucket(std::int64_t ns);
  static double upper_edge_ms(int bucket);

  std::array<std::atomic<std::uint64_t>, kBuckets> counts_{};
  std::atomic<std::uint64_t> total_ns_{0};
  std::atomic<std::int64_t> max_ns_{0};
};

}  // namespace booth::daemon

// Logarithmic buckets and the percentiles read from them.
#include "daemon/pipeline/latency_histogram.hpp"

#include <algorithm>
#include <cmath>

namespace booth::daemon {
namespace {
const double kLogRatio = std::log(1.05);
}

int LatencyHistogram::bucket(std::int64_t ns) {
  if (ns <= 1000) return 0;
  return std::min(kBuckets - 1, static_cast<int>(std::ceil(std::log(static_cast<double>(ns) / 1000.0) / kLogRatio)));
}

double LatencyHistogram::upper_edge_ms(int bucket) { return 1e-3 * std::exp(kLogRatio * bucket); }

void LatencyHistogram::add(hal::Nanoseconds duration) {
  const std::int64_t ns = std::max<std::int64_t>(0, duration.count());
  counts_[static_cast<std::size_t>(bucket(ns))].fetch_add(1, std::memory_order_relaxed);
  total_ns_.fetch_add(static_cast<std::uint64_t>(ns), std::memory_order_relaxed);
  std::int64_t seen = max_ns_.load(std::memory_order_relaxed);
  while (ns > seen && !max_ns_.compare_exchange_weak(seen, ns, std::memory_order_relaxed)) {
  }
}

void LatencyHistogram::reset() {
  for (auto& count : counts_) count.store(0, std::memory_order_relaxed);
  total_ns_.store(0, std::memory_order_relaxed);
  max_ns_.store(0, std::memory_order_relaxed);
}

LatencySummary LatencyHistogram::summary() const {
  std::array<std::uint64_t, kBuckets> counts;
  LatencySummary out;
  for (int b = 0; b < kBuckets; ++b) {
    counts[static_cast<std::size_t>(b)] = counts_[static_cast<std::size_t>(b)].load(std::memory_order_relaxed);
    out.count += counts[static_cast<std::size_t>(b)];
  }
  if (out.count == 0) return out;
  out.max_ms = 1e-6 * static_cast<double>(max_ns_.load(std::memory_order_relaxed));
  out.mean_ms = 1e-6 * static_cast<double>(total_ns_.load(std::memory_order_relaxed)) / static_cast<double>(out.count);
  const auto percentile = [&](double p) {
    const auto rank = static_cast<std::uint64_t>(std::ceil(p * static_cast<double>(out.count)));
    std::uint64_t below = 0;
    for (int b = 0; b < kBuckets; ++b) {
      below += counts[static_cast<std::size_t>(b)];
      if (below >= rank) return std::min(out.max_ms, upper_edge_ms(b));
    }
    return out.max_ms;
  };
  out.p50_ms = percentile(0.50);
  out.p95_ms = percentile(0.95);
  out.p99_ms = percentile(0.99);
  return out;
}

}  // namespace booth::daemon

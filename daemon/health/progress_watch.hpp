// Decides whether the daemon still lives, by counters that move only while their threads do.
#pragma once

#include <chrono>
#include <cstdint>
#include <vector>

namespace booth::daemon {

/// Pure. A counter that stands still for longer than the patience means a hung thread.
class ProgressWatch {
 public:
  explicit ProgressWatch(std::chrono::nanoseconds patience) : patience_(patience) {}

  /// Index of a counter that has stood still for too long, -1 while all is well. When the number of counters changes, all count as having moved.
  int stalled(const std::vector<std::uint64_t>& counters, std::chrono::nanoseconds now);

 private:
  std::chrono::nanoseconds patience_;
  std::vector<std::uint64_t> last_;
  std::vector<std::chrono::nanoseconds> moved_;
};

}  // namespace booth::daemon

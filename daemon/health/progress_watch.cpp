// Remembers when each counter moved last.
#include "daemon/health/progress_watch.hpp"

namespace booth::daemon {

int ProgressWatch::stalled(const std::vector<std::uint64_t>& counters, std::chrono::nanoseconds now) {
  if (counters.size() != last_.size()) {
    last_ = counters;
    moved_.assign(counters.size(), now);
  }
  int out = -1;
  for (std::size_t i = 0; i < counters.size(); ++i) {
    if (counters[i] != last_[i]) {
      last_[i] = counters[i];
      moved_[i] = now;
    } else if (now - moved_[i] > patience_) {
      out = static_cast<int>(i);
    }
  }
  return out;
}

}  // namespace booth::daemon

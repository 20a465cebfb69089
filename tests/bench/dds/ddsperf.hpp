// The reference: ddsperf's ping between two processes, with the size and rate of our skeletons.
#pragma once

#include <string>
#include <vector>

namespace booth::bench {

struct PingFigures {
  double p50_us = 0, p99_us = 0;  ///< one way: ddsperf prints half the round trip
  int count = 0;
};

/// One figure for each second that ddsperf has run, the first (discovery, cold caches) left out. `trigger`: "listener" or "waitset". `uri`: the library's
/// configuration. Throws std::runtime_error where ddsperf is not installed or says nothing.
std::vector<PingFigures> ddsperf_ping(const std::string& uri, int domain, int bytes, int hertz, int seconds, const std::string& trigger);

}  // namespace booth::bench

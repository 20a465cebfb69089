// The plan of a long run, its samples and its verdict.
#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <ostream>
#include <string>
#include <vector>

namespace booth::tests {

struct SoakPlan {
  std::filesystem::path folder;
  std::chrono::seconds length{7200};
  double window = 10;                   ///< minutes, at each end
  double session = 30, idle = 5;        ///< seconds of a session, and from its end to the next
  std::vector<std::string> settings{};  ///< of boothd, key=value
  std::uint64_t seed = 1;
  bool no_faults = false;
};

/// One look at boothd while it tracks somebody; what differs between processes (after a kill) is compared all the same: it must not.
struct SoakSample {
  double at = 0;  ///< seconds since the beginning
  double resident_kb = 0, descriptors = 0, threads = 0;
  double p99_ms = 0, fps = 0;  ///< of the session
};

struct SoakVerdict {
  double seconds = 0;
  std::map<std::string, int> faults;  ///< kind and times
  int sessions = 0, starts = 0;
  double ready_worst = 0;  ///< seconds
  std::vector<SoakSample> samples;
  SoakSample first, last;  ///< medians of the windows; p99_ms is the windows' median of the sessions' p99
  std::vector<std::string> wrong;
};

/// Sessions with idle between them, a fault in every third. Says what it does on `out`.
SoakVerdict soak(const SoakPlan& plan, std::ostream& out);

void print_text(std::ostream& out, const SoakVerdict& verdict);
std::string to_json(const SoakVerdict& verdict);
std::string to_markdown(const SoakVerdict& verdict);

}  // namespace booth::tests

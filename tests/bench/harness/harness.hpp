// What every benchmark task shares: options, repeated timing, and one way to report a figure beside its reference of the same run.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "fit/parallel.hpp"

namespace CLI {
class App;
}

namespace booth::bench {

/// One figure. `reference_value` is what it is compared with, measured in the same run and in the same unit; ratio = value / reference_value.
/// An empty `reference` means that the figure stands alone (a count, an error).
struct Result {
  std::string name, unit;
  double value = 0;
  std::string reference{};
  double reference_value = 0;
};

/// Collects a task's figures and prints them as a table or as one JSON object (docs/reference/benchmarks.md). Not thread-safe.
class Report {
 public:
  explicit Report(std::string benchmark) : benchmark_(std::move(benchmark)) {}
  void add(Result result) { results_.push_back(std::move(result)); }
  /// A fact about the run that is no figure ("kernel": "avx512"); printed with the machine.
  void note(const std::string& key, const std::string& value) { notes_.emplace_back(key, value); }
  const std::vector<Result>& results() const { return results_; }
  std::string table() const;
  std::string json() const;

 private:
  std::string benchmark_;
  std::vector<Result> results_;
  std::vector<std::pair<std::string, std::string>> notes_;
};

/// Seconds of one call: the median of `repeats` calls after one that is not counted. Where a neighbour steals the machine, compare medians of one run only.
double median_seconds(int repeats, fit::FunctionRef<void()> call);

/// The same for several candidates, taken in turns, so that a disturbance of the machine meets them all alike. In the order of `calls`.
std::vector<double> median_seconds_in_turns(int repeats, const std::vector<std::function<void()>>& calls);

/// The same in processor time of the calling thread, for calls that use no other: on a shared machine a long call is interrupted more often than a short one,
/// and wall time would flatter the short one.
std::vector<double> median_thread_seconds_in_turns(int repeats, const std::vector<std::function<void()>>& calls);

/// Seconds for a plain copy of so many bytes from and to memory that no cache holds: the memory floor of this machine in this run.
double copy_seconds(std::size_t bytes);

/// A task registers itself before main(): `add_options` gets the task's subcommand and returns what runs it. `--json` and `--short` are common to all.
struct Common {
  bool json = false;        ///< one JSON object on stdout, nothing else
  bool short_form = false;  ///< seconds instead of minutes; for tests, which check shapes and ratios but never times
};
using Run = std::function<void(const Common&, Report&)>;
struct Task {
  const char* name;
  const char* what;
  Run (*make)(CLI::App& options);
};
struct Registration {
  explicit Registration(const Task& task);
};
const std::vector<Task>& tasks();

}  // namespace booth::bench

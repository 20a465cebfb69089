// Timing and reporting; figures go to stdout, progress to stderr.
#include "tests/bench/harness/harness.hpp"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>

#include "daemon/ctl/bench_json.hpp"

namespace booth::bench {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_of(const auto& call) {
  const auto begin = Clock::now();
  call();
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Processor time of this thread: what a neighbour takes from it does not count.
double thread_seconds_of(const auto& call) {
  const auto now = [] {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
  };
  const double begin = now();
  call();
  return now() - begin;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<Task>& registered() {
  static std::vector<Task> all;
  return all;
}

}  // namespace

double median_seconds(int repeats, fit::FunctionRef<void()> call) {
  call();
  std::vector<double> times(static_cast<std::size_t>(std::max(1, repeats)));
  for (double& t : times) t = seconds_of(call);
  return median(std::move(times));
}

namespace {
std::vector<double> in_turns(int repeats, const std::vector<std::function<void()>>& calls, const auto& timed) {
  std::vector<std::vector<double>> times(calls.size());
  for (const auto& call : calls) call();
  for (int r = 0; r < std::max(1, repeats); ++r)
    for (std::size_t i = 0; i < calls.size(); ++i) times[i].push_back(timed(calls[i]));
  std::vector<double> out;
  for (auto& t : times) out.push_back(median(std::move(t)));
  return out;
}
}  // namespace

std::vector<double> median_seconds_in_turns(int repeats, const std::vector<std::function<void()>>& calls) {
  return in_turns(repeats, calls, [](const auto& call) { return seconds_of(call); });
}

std::vector<double> median_thread_seconds_in_turns(int repeats, const std::vector<std::function<void()>>& calls) {
  return in_turns(repeats, calls, [](const auto& call) { return thread_seconds_of(call); });
}

double copy_seconds(std::size_t bytes) {
  constexpr std::size_t kBeyondCaches = std::size_t{256} << 20;
  static const std::vector<char> from(kBeyondCaches, 1);
  static std::vector<char> to(kBeyondCaches, 2);
  const double all = median_seconds(5, [] { std::memcpy(to.data(), from.data(), kBeyondCaches); });
  return all * static_cast<double>(bytes) / static_cast<double>(kBeyondCaches);
}

Registration::Registration(const Task& task) { registered().push_back(task); }

const std::vector<Task>& tasks() {
  auto& all = registered();
  std::sort(all.begin(), all.end(), [](const Task& a, const Task& b) { return std::strcmp(a.name, b.name) < 0; });
  return all;
}

std::string Report::table() const {
  std::size_t name = 4, reference = 9;
  for (const Result& r : results_) name = std::max(name, r.name.size()), reference = std::max(reference, r.reference.size());
  std::string out;
  for (const auto& [key, value] : notes_) out += fmt::format("{}: {}\n", key, value);
  out += fmt::format("{:<{}}  {:>12} {:<8}  {:<{}}  {:>12}  {:>8}\n", "name", name, "value", "unit", "reference", reference, "", "ratio");
  for (const Result& r : results_) {
    out += fmt::format("{:<{}}  {:>12.5g} {:<8}", r.name, name, r.value, r.unit);
    if (!r.reference.empty()) out += fmt::format("  {:<{}}  {:>12.5g}  {:>8.4g}", r.reference, reference, r.reference_value, r.value / r.reference_value);
    out += "\n";
  }
  return out;
}

std::string Report::json() const {
  auto results = nlohmann::ordered_json::array();
  for (const Result& r : results_) {
    nlohmann::ordered_json one{{"name", r.name}, {"unit", r.unit}, {"value", r.value}};
    if (!r.reference.empty()) one["reference"] = r.reference, one["reference_value"] = r.reference_value, one["ratio"] = r.value / r.reference_value;
    results.push_back(std::move(one));
  }
  return daemon::bench_json(benchmark_, notes_, std::move(results)).dump(2);
}

}  // namespace booth::bench

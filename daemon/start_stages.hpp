// What a start needs, asked for stage by stage: the first failure ends a start, while a check of the configuration goes on to the last.
#pragma once

#include <set>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "daemon/config/load.hpp"

namespace booth::daemon {

enum ExitStatus { kStopped = 0, kUsage = 64, kUnavailable = 69, kInternal = 70, kAgain = 75, kConfiguration = 78 };

/// An error that knows its exit status.
struct StartFailure : std::runtime_error {
  StartFailure(ExitStatus s, const std::string& what) : std::runtime_error(what), status(s) {}
  ExitStatus status;
};

class StartStages {
 public:
  enum class At : std::uint8_t { start, check };

  /// `settings` must outlive it.
  StartStages(const LoadedConfig& settings, At at) : settings_(settings), at_(at) {}

  /// At a start throws StartFailure with the place of the key. In a check notes it: each sentence once, and none that rests on a key which is in doubt and has
  /// been complained about for that.
  void fail(ExitStatus status, KeyProblem problem) {
    const std::string text = settings_.placed(problem);
    if (at_ == At::start) throw StartFailure(status, text);
    for (const auto key : problem.keys)
      if (settings_.in_doubt.contains(key)) return;
    if (said_.insert(std::move(problem.sentence)).second) failures_.emplace_back(status, text);
  }

  /// What `make` returns. Where it throws, it fails with the status of its StartFailure, or this one; in a check a default value then stands for the result.
  template <class F>
  std::invoke_result_t<F> run(ExitStatus status, std::vector<std::string_view> keys, F make) {
    try {
      return make();
    } catch (const StartFailure& e) {
      fail(e.status, {keys, e.what()});
    } catch (const std::exception& e) {
      fail(status, {keys, e.what()});
    }
    return std::invoke_result_t<F>();
  }

  const std::vector<StartFailure>& failures() const { return failures_; }  ///< of a check, in the order of the stages

 private:
  const LoadedConfig& settings_;
  const At at_;
  std::set<std::string> said_;
  std::vector<StartFailure> failures_;
};

}  // namespace booth::daemon

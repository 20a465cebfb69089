// What a table of the evaluation consists of: units of work that can be done one by one, goals, and figures printed elsewhere to compare with.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tests/accuracy/report/samples.hpp"

namespace booth::accuracy {

class Subjects;

/// What a person asked for.
struct Request {
  bool short_form = false;                     ///< a part of the bodies and poses: minutes instead of hours
  std::filesystem::path data;                  ///< folder with train/q.npy and train/clips.csv; empty: motions of the project's own
  std::shared_ptr<const Subjects> subjects{};  ///< models and set-aside bodies
};

/// A part of the work whose result is kept when the run is interrupted. `key` names it within its table and must not change between runs.
struct Unit {
  std::string key;
  std::function<Samples()> run;
};

/// mean of (case, method, metric) must be at most (or at least) `limit`; `case_name` may end in * for all cases that begin so. `text` says where it is from.
struct Goal {
  std::string case_name, method, metric;
  bool at_least = false;
  double limit = 0;
  enum class Figure { mean, p95, most } figure = Figure::mean;
};

/// A figure as somebody else printed it.
struct Published {
  std::string case_name, method;
  double mean_cm = 0, sd_cm = 0;
};

struct Plan {
  std::string protocol;  ///< Markdown: what was done, so that the figures can be read
  std::vector<Unit> units;
  std::vector<Goal> goals{};
  std::vector<Published> published{};
  /// Draws into a folder and returns the file names; may be empty.
  std::function<std::vector<std::string>(const Samples&, const std::filesystem::path&)> pictures{};
};

/// One value of --table.
struct Experiment {
  const char* name;
  const char* title;
  Plan (*plan)(const Request&);
};
/// All of them, in the order of the report.
const std::vector<Experiment>& experiments();

/// True once the person wants to stop (SIGINT, SIGTERM); long units look at it between frames and throw Interrupted.
bool stop_requested();
struct Interrupted {};
inline void stop_if_requested() {
  if (stop_requested()) throw Interrupted{};
}

}  // namespace booth::accuracy

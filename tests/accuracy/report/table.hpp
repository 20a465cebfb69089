// A finished (or unfinished) table as JSON and as Markdown.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/accuracy/report/plan.hpp"

namespace booth::accuracy {

struct Table {
  std::string name, title, command;
  bool short_form = false;
  std::size_t done = 0, planned = 0;  ///< units
  double seconds = 0;                 ///< of processor time
  Samples samples;
  std::vector<std::string> pictures;
  /// What the figures are of, beyond the rows: seeds, models, data.
  std::vector<std::pair<std::string, std::string>> facts;
};

/// Key of a figure in a row: "mean_cm", "p95_mm", "mean_percent".
std::string figure_key(Goal::Figure figure, const std::string& unit);

struct GoalState {
  const Goal* goal;
  const Sample* row;
  double value;
  bool met;
};
/// Every goal against every row that it is about.
std::vector<GoalState> judge(const Plan& plan, const Samples& samples);

nlohmann::ordered_json to_json(const Table& table, const Plan& plan);
/// A page that stands by itself.
std::string to_markdown(const Table& table, const Plan& plan);

}  // namespace booth::accuracy

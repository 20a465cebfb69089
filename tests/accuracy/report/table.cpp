// Rows in the order in which the plan first mentions them.
#include "tests/accuracy/report/table.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace booth::accuracy {
namespace {

double figure_of(const Sample& row, Goal::Figure figure) {
  switch (figure) {
    case Goal::Figure::p95:
      return row.tally.quantile(0.95);
    case Goal::Figure::most:
      return row.tally.most();
    case Goal::Figure::mean:
      break;
  }
  return row.tally.mean();
}

bool about(const Goal& goal, const Sample& row) {
  if (goal.method != row.method || goal.metric != row.metric) return false;
  if (goal.case_name.ends_with('*')) return row.case_name.starts_with(std::string_view(goal.case_name).substr(0, goal.case_name.size() - 1));
  return goal.case_name == row.case_name;
}

/// Three significant digits, never in exponents.
std::string number(double v) {
  const double a = std::abs(v);
  return a >= 100 ? fmt::format("{:.0f}", v) : a >= 10 ? fmt::format("{:.1f}", v) : fmt::format("{:.2f}", v);
}

std::string rows_in_markdown(const Table& table, const Plan& plan) {
  const auto states = judge(plan, table.samples);
  std::string out = "| case | method | metric | mean | sd | 95 % | most | n | goal |\n|---|---|---|---|---|---|---|---|---|\n";
  for (const Sample& row : table.samples.rows()) {
    const bool share = row.unit == "percent";
    std::string goals;
    for (const GoalState& s : states)
      if (s.row == &row)
        goals += fmt::format("{}{}{} {}: {}", goals.empty() ? "" : "; ",
                             s.goal->figure == Goal::Figure::mean  ? ""
                             : s.goal->figure == Goal::Figure::p95 ? "95 % "
                                                                   : "most ",
                             s.goal->at_least ? ">=" : "<=", number(s.goal->limit), s.met ? "met" : "**missed**");
    out += fmt::format("| {} | {} | {}, {} | {} | {} | {} | {} | {} | {} |\n", row.case_name, row.method, row.metric, share ? "%" : row.unit,
                       number(row.tally.mean()), share ? "" : number(row.tally.sd()), share ? "" : number(row.tally.quantile(0.95)),
                       share ? "" : number(row.tally.most()), row.tally.n(), goals);
  }
  return out;
}

}  // namespace

std::string figure_key(Goal::Figure figure, const std::string& unit) {
  return (figure == Goal::Figure::mean ? "mean_" : figure == Goal::Figure::p95 ? "p95_" : "max_") + unit;
}

std::vector<GoalState> judge(const Plan& plan, const Samples& samples) {
  std::vector<GoalState> out;
  for (const Goal& goal : plan.goals)
    for (const Sample& row : samples.rows()) {
      if (!about(goal, row) || row.tally.empty()) continue;
      const double value = figure_of(row, goal.figure);
      out.push_back({&goal, &row, value, goal.at_least ? value >= goal.limit : value <= goal.limit});
    }
  return out;
}

nlohmann::ordered_json to_json(const Table& table, const Plan& plan) {
  using Json = nlohmann::ordered_json;
  Json rows = Json::array(), goals = Json::array(), published = Json::array(), facts = Json::object();
  for (const Sample& row : table.samples.rows()) {
    const std::string& u = row.unit;
    rows.push_back({{"case", row.case_name},
                    {"method", row.method},
                    {"metric", row.metric},
                    {"mean_" + u, row.tally.mean()},
                    {"sd_" + u, row.tally.sd()},
                    {"p95_" + u, row.tally.quantile(0.95)},
                    {"max_" + u, row.tally.most()},
                    {"n", row.tally.n()}});
  }
  for (const GoalState& s : judge(plan, table.samples))
    goals.push_back({{"case", s.row->case_name},
                     {"method", s.row->method},
                     {"metric", s.row->metric},
                     {"figure", figure_key(s.goal->figure, s.row->unit)},
                     {"wanted", fmt::format("{} {}", s.goal->at_least ? ">=" : "<=", s.goal->limit)},
                     {"value", s.value},
                     {"met", s.met}});
  for (const Published& p : plan.published) published.push_back({{"case", p.case_name}, {"method", p.method}, {"mean_cm", p.mean_cm}, {"sd_cm", p.sd_cm}});
  for (const auto& [key, value] : table.facts) facts[key] = value;
  Json out{{"table", table.name}, {"rows", std::move(rows)}};
  if (!goals.empty()) out["goals"] = std::move(goals);
  if (!published.empty()) out["published"] = std::move(published);
  if (!table.pictures.empty()) out["pictures"] = table.pictures;
  out["complete"] = table.done == table.planned;
  out["units"] = {{"done", table.done}, {"planned", table.planned}};
  out["short"] = table.short_form;
  out["processor_seconds"] = table.seconds;
  out["command"] = table.command;
  out["facts"] = std::move(facts);
  return out;
}

std::string to_markdown(const Table& table, const Plan& plan) {
  std::string out = fmt::format("# {}\n\n<!-- Written by `{}`; do not edit by hand. -->\n\n{}\n\n", table.title, table.command, plan.protocol);
  out += fmt::format("Made by `{}`: {} of {} units of work, {:.0f} s of processor time{}.\n", table.command, table.done, table.planned, table.seconds,
                     table.done == table.planned ? "" : " (**not finished**: the figures are of what is done)");
  for (const auto& [key, value] : table.facts) out += fmt::format("{}: {}. ", key, value);
  out += "\n\n" + rows_in_markdown(table, plan);
  if (!plan.published.empty()) {
    out += "\nAs printed in the paper (its error and its noise are not defined there):\n\n| case | method | mean, cm | sd, cm |\n|---|---|---|---|\n";
    for (const Published& p : plan.published) out += fmt::format("| {} | {} | {} | {} |\n", p.case_name, p.method, number(p.mean_cm), number(p.sd_cm));
  }
  for (const std::string& picture : table.pictures) out += fmt::format("\n![{0}]({0})\n", picture);
  return out;
}

}  // namespace booth::accuracy

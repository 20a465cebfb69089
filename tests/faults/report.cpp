// Three forms of the same rows.
#include "tests/faults/report.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace booth::tests {
namespace {

std::string seconds(double value) { return value < 0 ? "-" : fmt::format("{:.1f}", value); }

std::string verdict(const FaultRow& row) {
  if (!row.skipped.empty()) return "skipped: " + row.skipped;
  if (!row.wrong.empty()) return fmt::format("**{} wrong**: {}", row.wrong.size(), row.wrong.front().substr(0, row.wrong.front().find('\n')));
  if (!as_expected(row, true)) return "**too late**";
  return row.seen.empty() ? "as expected" : row.seen;
}

}  // namespace

bool as_expected(const FaultRow& row, bool judge_times) {
  return row.wrong.empty() && !(judge_times && (row.ready_worst > kReadyPromise || row.whole_worst > kWholePromise));
}

void print_text(std::ostream& out, const FaultRow& row) {
  out << fmt::format("{}: {} times\n  expected  {}\n", row.fault, row.times, row.expected);
  if (!row.skipped.empty()) {
    out << "  skipped: " << row.skipped << "\n";
    return;
  }
  if (row.ready_worst >= 0) out << fmt::format("  READY     {} s at most; all cameras {} s\n", seconds(row.ready_worst), seconds(row.whole_worst));
  if (!row.seen.empty()) out << "  seen      " << row.seen << "\n";
  for (const auto& sentence : row.wrong) out << "  WRONG     " << sentence << "\n";
  out.flush();
}

void print_markdown(std::ostream& out, const std::vector<FaultRow>& rows) {
  out << "| fault | expected | times | READY, s | whole, s | seen |\n|---|---|---|---|---|---|\n";
  for (const auto& row : rows)
    out << fmt::format("| {} | {} | {} | {} | {} | {} |\n", row.fault, row.expected, row.times, seconds(row.ready_worst), seconds(row.whole_worst),
                       verdict(row));
}

void print_json(std::ostream& out, const std::vector<FaultRow>& rows) {
  auto list = nlohmann::json::array();
  for (const auto& row : rows)
    list.push_back({{"fault", row.fault},
                    {"expected", row.expected},
                    {"times", row.times},
                    {"ready_worst_seconds", row.ready_worst},
                    {"whole_worst_seconds", row.whole_worst},
                    {"seen", row.seen},
                    {"wrong", row.wrong},
                    {"skipped", row.skipped}});
  out << list.dump(2) << "\n";
}

}  // namespace booth::tests

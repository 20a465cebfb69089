// What was expected and what was seen, one row for each fault: as text, as Markdown, as JSON.
#pragma once

#include <algorithm>
#include <ostream>
#include <string>
#include <vector>

namespace booth::tests {

struct FaultRow {
  std::string fault, expected;
  int times = 0;
  double ready_worst = -1;  ///< seconds from the fault to READY, or to an answer where boothd lives on; -1: not asked here
  double whole_worst = -1;  ///< seconds until all cameras run
  std::string seen{};
  std::vector<std::string> wrong{};  ///< sentences; empty: as expected
  std::string skipped{};             ///< why it was not tried

  void ready(double seconds) { ready_worst = std::max(ready_worst, seconds); }
  void whole(double seconds) { whole_worst = std::max(whole_worst, seconds); }
};

/// What the appliance promises, seconds.
inline constexpr double kReadyPromise = 10, kWholePromise = 30;

/// The row keeps its promises: nothing wrong, and within the times. Where times are not to be judged (a busy machine, a test) only what is wrong counts.
bool as_expected(const FaultRow& row, bool judge_times);
void print_text(std::ostream& out, const FaultRow& row);
void print_markdown(std::ostream& out, const std::vector<FaultRow>& rows);
void print_json(std::ostream& out, const std::vector<FaultRow>& rows);

}  // namespace booth::tests

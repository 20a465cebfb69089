// booth-faults: tries each fault on boothd as a process and says what was expected and what was seen.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/faults/faults.hpp"

int main(int argc, char** argv) {
  using namespace booth::tests;
  CLI::App app{"Faults on boothd with simulated cameras, watched as systemd would; what was expected, what was seen.", "booth-faults"};
  FaultPlan plan;
  std::vector<std::string> names;
  std::string markdown, json;
  std::uint64_t seed = 1;
  bool judge_times = false;
  app.add_option("fault", names, "Which; without any, all of them");
  app.add_option("--times", plan.times, "Faults at random moments")->check(CLI::Range(1, 10000));
  app.add_option("--regions", plan.regions, "Regions of each file")->check(CLI::Range(1, 100000));
  app.add_option("--seed", seed, "Of the random moments");
  app.add_option("--markdown", markdown, "Table for the reference page");
  app.add_option("--json", json, "The same for programs");
  app.add_flag("--judge-times", judge_times, "Fail when READY takes more than 10 s or all cameras more than 30 s: for a machine that does nothing else");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 64;
  }
  for (const auto& name : names)
    if (std::none_of(all_faults().begin(), all_faults().end(), [&](const Fault& f) { return f.name == name; })) {
      std::cerr << "booth-faults: no fault \"" << name << "\"; there are";
      for (const auto& fault : all_faults()) std::cerr << " " << fault.name;
      std::cerr << "\n";
      return 64;
    }
  std::vector<FaultRow> rows;
  bool good = true;
  for (const auto& fault : all_faults()) {
    if (!names.empty() && std::count(names.begin(), names.end(), fault.name) == 0) continue;
    const TemporaryFolder folder;
    plan.folder = folder.path;
    plan.random.seed(seed);
    rows.push_back(fault.run(plan));
    print_text(std::cout, rows.back());
    good = good && as_expected(rows.back(), judge_times);
  }
  if (!markdown.empty()) {
    std::ofstream out(markdown);
    print_markdown(out, rows);
  }
  if (!json.empty()) {
    std::ofstream out(json);
    print_json(out, rows);
  }
  return good ? 0 : 1;
}

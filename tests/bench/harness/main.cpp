// booth-bench: runs one task and prints its figures. `boothctl bench TASK` calls it.
#include <CLI/CLI.hpp>
#include <iostream>

#include "tests/bench/harness/harness.hpp"

int main(int argc, char** argv) {
  using namespace booth::bench;
  constexpr int kUsage = 64;
  CLI::App app{"Measures boothd's parts against references of the same run.", "boothctl bench"};
  app.require_subcommand(1);
  Common common;
  std::string running;
  for (const Task& task : tasks()) {
    CLI::App* verb = app.add_subcommand(task.name, task.what);
    verb->add_flag("--json", common.json, "One JSON object, nothing else");
    verb->add_flag("--short", common.short_form, "Seconds instead of minutes, for a first look and for tests");
    verb->callback([&common, &running, name = task.name, run = task.make(*verb)] {
      running = std::string(name) + ": ";
      Report report(name);
      run(common, report);
      std::cout << (common.json ? report.json() + "\n" : report.table());
    });
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : kUsage;
  } catch (const std::exception& e) {
    std::cerr << "boothctl: bench " << running << e.what() << "\n";  // as boothctl says what it cannot do
    return 1;
  }
  return std::cout.good() ? 0 : 1;
}

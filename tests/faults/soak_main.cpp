// booth-soak: boothd works for hours while faults come on a schedule; what it holds and how fast it is must be the same at the end.

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "tests/daemon/support/temporary_folder.hpp"
#include "tests/faults/soak.hpp"

int main(int argc, char** argv) {
  using namespace booth::tests;
  CLI::App app{
      "A long run of boothd with simulated cameras: sessions, idle, faults on a schedule; memory, descriptors, threads and latency, first against last.",
      "booth-soak"};
  SoakPlan plan;
  std::string json, markdown;
  double hours = 2;
  app.add_option("--hours", hours, "Length")->check(CLI::Range(0.002, 1000.0));
  app.add_option("--window", plan.window, "Minutes at the beginning and at the end that are compared")->check(CLI::Range(0.02, 600.0));
  app.add_option("--session", plan.session, "Seconds of a session")->check(CLI::Range(0.5, 3600.0));
  app.add_option("--idle", plan.idle, "Seconds from the end of a session to the next")->check(CLI::Range(0.0, 86400.0));
  app.add_option("--set", plan.settings, "key=value of boothd's configuration; may be given several times")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_option("--seed", plan.seed, "Of the schedule");
  app.add_flag("--no-faults", plan.no_faults, "Sessions and idle only, in one process from begin to end");
  app.add_option("--json", json, "Samples and verdict");
  app.add_option("--markdown", markdown, "The verdict as a table");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 64;
  }
  plan.length = std::chrono::duration_cast<std::chrono::seconds>(std::chrono::duration<double>(hours * 3600));
  if (plan.window * 120 > static_cast<double>(plan.length.count())) {
    std::cerr << "booth-soak: the first and the last " << plan.window << " minutes overlap in " << plan.length.count() << " s; give a smaller --window\n";
    return 64;
  }
  const TemporaryFolder folder;
  plan.folder = folder.path;
  const SoakVerdict verdict = soak(plan, std::cout);
  print_text(std::cout, verdict);
  if (!json.empty()) std::ofstream(json) << to_json(verdict);
  if (!markdown.empty()) std::ofstream(markdown) << to_markdown(verdict);
  return verdict.wrong.empty() ? 0 : 1;
}

// booth-evaluate: the accuracy study. `boothctl evaluate` calls it.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <csignal>
#include <iostream>
#include <nlohmann/json.hpp>

#include "daemon/io/mocap_folder.hpp"
#include "tests/accuracy/booth/subjects.hpp"
#include "tests/accuracy/report/journal.hpp"
#include "tests/accuracy/report/run.hpp"

namespace booth::accuracy {
namespace {

std::atomic<bool> stop{false};

/// The first signal ends the run after the unit in hand; the second one ends the program at once.
void on_signal(int number) {
  stop = true;
  std::signal(number, SIG_DFL);
}

/// Throws with the path and the reason when nothing can be written there.
void prepare_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw std::runtime_error(fmt::format("--out {}: the folder cannot be made: {}", folder.string(), error.message()));
  if (!std::filesystem::is_directory(folder, error)) throw std::runtime_error(fmt::format("--out {}: is not a folder", folder.string()));
}

struct Arguments {
  std::vector<std::string> tables;
  bool short_form = false, json = false, list = false;
  std::filesystem::path data, out, models;
};

/// As the pages name the run: without what differs from machine to machine.
std::string command_of(const Arguments& a, const char* table) {
  return fmt::format("boothctl evaluate --table {}{}{}", table, a.short_form ? " --short" : "", a.data.empty() ? "" : " --data MOTIONS");
}

constexpr int kInterrupted = 130;

int run(const Arguments& arguments) {
  if (arguments.list) {
    for (const Experiment& e : experiments()) std::cout << fmt::format("{:<13} {}\n", e.name, e.title);
    return 0;
  }
  RunOptions options;
  options.request.short_form = arguments.short_form;
  options.request.data = arguments.data;
  if (!arguments.out.empty()) {
    prepare_folder(arguments.out);
    options.out = arguments.out;
  }
  options.request.subjects = std::make_shared<const Subjects>(arguments.models);
  options.identity = file_identity("/proc/self/exe") + " " + options.request.subjects->identity();
  options.facts = {{"models", options.request.subjects->versions()},
                   {"motions", arguments.data.empty() ? "the project's own" : "those set aside of the folder given with --data"}};
  // A folder that is no motion folder is found out now, not in an hour.
  if (!arguments.data.empty()) daemon::load_motion_folder(arguments.data, options.request.subjects->folder() / "held_out_motions.csv");

  auto all = nlohmann::ordered_json::array();
  bool interrupted = false;
  for (const Experiment& e : experiments()) {
    if (!arguments.tables.empty() && std::find(arguments.tables.begin(), arguments.tables.end(), e.name) == arguments.tables.end()) continue;
    options.command = command_of(arguments, e.name);
    const TableRun result = run_table(e, options);
    if (arguments.json) {
      all.push_back(to_json(result.table, result.plan));
    } else {
      std::cout << to_markdown(result.table, result.plan) << "\n";
    }
    if (result.interrupted) {
      interrupted = true;
      break;
    }
  }
  if (arguments.json) std::cout << (all.size() == 1 ? all[0] : nlohmann::ordered_json{{"tables", all}}).dump(1) << "\n";
  if (!interrupted) return std::cout.good() ? 0 : 1;
  std::cerr << "boothctl: evaluate: stopped; "
            << (arguments.out.empty() ? "without --out nothing is kept\n" : "the same command goes on where this one ended (" + arguments.out.string() + ")\n");
  return kInterrupted;
}

}  // namespace

bool stop_requested() { return stop; }

}  // namespace booth::accuracy

int main(int argc, char** argv) {
  using namespace booth::accuracy;
  constexpr int kUsage = 64;
  CLI::App app{"Measures boothd's errors where the truth is known: the paper's experiments, and ours.", "boothctl evaluate"};
  Arguments arguments;
  std::vector<std::string> names;
  for (const Experiment& e : experiments()) names.emplace_back(e.name);
  app.add_option("--table", arguments.tables, "Which table (may be repeated); all when left out. --list says what each is")->check(CLI::IsMember(names));
  app.add_flag("--short", arguments.short_form, "A part of the bodies and poses: minutes instead of hours");
  app.add_option("--data", arguments.data, "Folder of recorded motions (train/q.npy, train/clips.csv) of which those set aside are used")
      ->check(CLI::ExistingDirectory);
  app.add_option("--out", arguments.out, "Folder for NAME.json, NAME.md and pictures; a run that was stopped goes on from there");
  app.add_option("--models", arguments.models, "Folder of men.npz, women.npz, pose.npz and test_bodies.npz")->check(CLI::ExistingDirectory);
  app.add_flag("--json", arguments.json, "JSON on stdout instead of Markdown");
  app.add_flag("--list", arguments.list, "Say what tables there are, and end");
  try {
    app.parse(argc, argv);
    std::signal(SIGINT, on_signal);
    std::signal(SIGTERM, on_signal);
    return run(arguments);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : kUsage;
  } catch (const std::exception& e) {
    std::cerr << "boothctl: evaluate: " << e.what() << "\n";  // as boothctl says what it cannot do
    return 1;
  }
}

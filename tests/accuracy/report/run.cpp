// A unit that fails ends the run with its name; a unit that is stopped leaves no trace.
#include "tests/accuracy/report/run.hpp"

#include <fmt/format.h>
#include <time.h>
#include <unistd.h>

#include <chrono>
#include <iostream>
#include <stdexcept>

#include "daemon/io/atomic_file.hpp"
#include "tests/accuracy/report/journal.hpp"

namespace booth::accuracy {
namespace {

double processor_seconds() {
  timespec t{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// One line that is written over, on a terminal only.
class Progress {
 public:
  Progress(const char* table, std::size_t planned) : table_(table), planned_(planned), shown_(isatty(STDERR_FILENO) != 0) {}
  ~Progress() {
    if (shown_) std::cerr << "\r\033[K" << std::flush;
  }
  void show(std::size_t done, std::size_t resumed, const std::string& unit) const {
    if (!shown_) return;
    const double passed = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    std::string left;
    if (done > resumed && passed > 2)
      left = fmt::format(", about {:.0f} min left", passed / 60 * static_cast<double>(planned_ - done) / static_cast<double>(done - resumed));
    std::cerr << fmt::format("\r\033[Ktable {}: {} of {}{} ({})", table_, done, planned_, left, unit) << std::flush;
  }

 private:
  const char* table_;
  std::size_t planned_;
  bool shown_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

void write(const std::filesystem::path& folder, Table& table, const Plan& plan) {
  if (table.done == table.planned && plan.pictures) table.pictures = plan.pictures(table.samples, folder);
  daemon::write_file_atomically(folder / (table.name + ".json"), to_json(table, plan).dump(1) + "\n");
  daemon::write_file_atomically(folder / (table.name + ".md"), to_markdown(table, plan));
}

}  // namespace

TableRun run_table(const Experiment& experiment, const RunOptions& options) {
  const Request& request = options.request;
  // Pages of recorded motions stand beside those of the project's own.
  const std::string name = std::string(experiment.name) + (request.data.empty() ? "" : "-recorded");
  Journal journal(options.out, name,
                  fmt::format("{} {}{} data={}", options.identity, experiment.name, request.short_form ? " short" : "", request.data.string()));
  TableRun run;
  run.plan = experiment.plan(request);
  Table& table = run.table;
  table.name = name, table.title = std::string(experiment.title) + (request.data.empty() ? "" : ", recorded motions"), table.command = options.command;
  table.facts = options.facts;
  table.short_form = request.short_form;
  table.planned = run.plan.units.size();
  {
    const Progress progress(experiment.name, table.planned);
    std::size_t resumed = 0;
    for (const Unit& unit : run.plan.units) {
      const Finished* finished = journal.find(unit.key);
      if (finished) {
        ++resumed;
      } else {
        if (stop_requested()) break;
        progress.show(table.done, resumed, unit.key);
        try {
          const double begin = processor_seconds();
          Samples samples = unit.run();
          finished = &journal.add(unit.key, {std::move(samples), processor_seconds() - begin});
        } catch (const Interrupted&) {
          break;
        } catch (const std::exception& e) {
          throw std::runtime_error(fmt::format("table {}, {}: {}", experiment.name, unit.key, e.what()));
        }
      }
      table.samples.merge(finished->samples);
      table.seconds += finished->seconds;
      ++table.done;
    }
  }
  run.interrupted = table.done < table.planned;
  if (!options.out.empty()) {
    write(options.out, table, run.plan);
    if (!run.interrupted) journal.remove();
  }
  return run;
}

}  // namespace booth::accuracy

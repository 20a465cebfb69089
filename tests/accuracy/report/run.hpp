// Runs one table to its end, or to where the person stops it, and writes what came out.
#pragma once

#include <filesystem>
#include <string>

#include "tests/accuracy/report/plan.hpp"
#include "tests/accuracy/report/table.hpp"

namespace booth::accuracy {

struct RunOptions {
  Request request;
  std::filesystem::path out;                                 ///< empty: nothing is written
  std::string command;                                       ///< as the pages name it
  std::string identity;                                      ///< program and models; results of another one are not resumed
  std::vector<std::pair<std::string, std::string>> facts{};  ///< Table::facts
};

struct TableRun {
  Table table;
  Plan plan;
  bool interrupted = false;
};

/// Units in order, those of an earlier run taken from its journal; progress on stderr when that is a terminal. With `out`: NAME.json, NAME.md and pictures,
/// also when interrupted (marked as not complete, and the journal stays); NAME ends in -recorded where the request names recorded motions. Throws
/// std::runtime_error when the folder cannot be written.
TableRun run_table(const Experiment& experiment, const RunOptions& options);

}  // namespace booth::accuracy

// Comma-separated tables that training reads: people, clips, and the lists of what is set aside. No quotes: none of them needs any.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/io/text_scanner.hpp"

namespace booth::daemon {

/// The rows of one table, in order; blank lines and lines that begin with # are passed over.
class TableRows {
 public:
  /// Reads the whole file, 64 MiB at most. Throws std::runtime_error: the file, why it cannot be read, and `without`, what the reader is to do then.
  TableRows(std::filesystem::path file, std::string_view without);
  TableRows(const TableRows&) = delete;  // it points into its own text
  TableRows& operator=(const TableRows&) = delete;

  /// False at the end.
  bool next();

  const std::vector<std::string>& cells() const { return cells_; }  ///< of the current row; one at least
  int whole(std::size_t cell) const;                                ///< that cell as a whole number; fails when it is none

  /// Throws std::runtime_error that names the file and, from the first row on, the line.
  [[noreturn]] void fail(const std::string& what) const;

 private:
  std::filesystem::path file_;
  std::string text_;
  TextScanner lines_;
  std::vector<std::string> cells_;
};

}  // namespace booth::daemon

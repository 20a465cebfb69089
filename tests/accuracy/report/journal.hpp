// Results of finished units on disk, so that a run of hours survives being stopped.
#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>

#include "tests/accuracy/report/samples.hpp"

namespace booth::accuracy {

struct Finished {
  Samples samples;
  double seconds = 0;  ///< of processor time
};

/// NAME.partial.jsonl in the folder: a line that identifies the run, then a line for each unit. A file of another program, other models or other
/// options is begun anew. A last line that was cut off is dropped. Not thread-safe.
class Journal {
 public:
  /// Empty folder: kept in memory only. Throws std::runtime_error naming the path when it cannot be written.
  Journal(const std::filesystem::path& folder, const std::string& name, const std::string& identity);

  const Finished* find(const std::string& key) const;
  const Finished& add(const std::string& key, Finished finished);
  std::size_t resumed() const { return resumed_; }
  /// The table is written: the file is not needed any more.
  void remove();

 private:
  void write(const std::string& line);
  std::filesystem::path path_;
  std::ofstream file_;
  std::map<std::string, Finished> finished_;
  std::size_t resumed_ = 0;
};

/// A hash of a file's bytes. Of /proc/self/exe: a result of another build of this program must not be mixed in.
std::string file_identity(const std::filesystem::path& path);

}  // namespace booth::accuracy

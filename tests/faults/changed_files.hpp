// Files with one byte changed, one region after another, and programs that have to live with them.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <random>
#include <string>
#include <vector>

namespace booth::tests {

/// Calls `look` for each of `regions` even parts of `file`, with one random byte of it changed; afterwards the file is as before. Small files have fewer parts.
void with_each_region_changed(const std::filesystem::path& file, int regions, std::mt19937_64& random, const std::function<void(std::size_t at)>& look);

struct Ended {
  int status = -1;  ///< exit status; -1: a signal ended it, or it did not end in time
  std::string output;
};
Ended run_program(std::vector<std::string> command, const std::filesystem::path& output, std::chrono::seconds limit = std::chrono::seconds(120));
/// `work` in a process of its own, so that a crash is seen and not shared.
Ended run_apart(const std::function<int()>& work, std::chrono::seconds limit = std::chrono::seconds(60));

}  // namespace booth::tests

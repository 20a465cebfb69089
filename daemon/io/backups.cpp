// The order is in the times of the files, and each new one is given a time behind the others.
#include "daemon/io/backups.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace booth::daemon {
namespace {

namespace fs = std::filesystem;

constexpr auto kStep = std::chrono::seconds(2);  // of the coarsest file system (FAT)

/// Where the clock has gone back the file's own time would be before that of files which are older.
void put_last(const fs::path& just_written, const std::vector<fs::path>& others) {
  std::error_code error;
  auto newest = fs::file_time_type::min();
  for (const auto& path : others)
    if (const auto written = fs::last_write_time(path, error); !error) newest = std::max(newest, written);
  if (newest >= fs::file_time_type::max() - kStep) return;
  if (const auto written = fs::last_write_time(just_written, error); !error && written <= newest) fs::last_write_time(just_written, newest + kStep, error);
}

}  // namespace

void sort_backups(std::vector<fs::path>& backups) {
  std::vector<std::pair<fs::file_time_type, fs::path>> order;
  for (const auto& path : backups) {
    std::error_code error;
    const auto written = fs::last_write_time(path, error);
    order.emplace_back(error ? fs::file_time_type::min() : written, path);
  }
  std::sort(order.begin(), order.end());
  backups.clear();
  for (const auto& [written, path] : order) backups.push_back(path);
}

void keep_newest_backups(std::vector<fs::path> backups, const fs::path& just_written, std::size_t most) {
  std::erase(backups, just_written);
  put_last(just_written, backups);
  sort_backups(backups);
  std::error_code ignored;
  for (std::size_t i = 0; i + (most - 1) < backups.size(); ++i) fs::remove(backups[i], ignored);
}

}  // namespace booth::daemon

// A clock is asked only for what is still to come.
#include "daemon/io/backups.hpp"

#include <algorithm>
#include <chrono>
#include <tuple>

namespace booth::daemon {

namespace fs = std::filesystem;

void sort_backups(std::vector<fs::path>& backups) {
  const auto now = fs::file_time_type::clock::now() + std::chrono::minutes(1);  // clocks are put right by seconds every day
  std::vector<std::tuple<bool, fs::file_time_type, fs::path>> order;
  for (const auto& path : backups) {
    std::error_code error;
    const auto written = fs::last_write_time(path, error);
    order.emplace_back(!error && written <= now, error ? fs::file_time_type::min() : written, path);
  }
  std::sort(order.begin(), order.end());
  backups.clear();
  for (const auto& [past, written, path] : order) backups.push_back(path);
}

void keep_newest_backups(std::vector<fs::path> backups, const fs::path& just_written, std::size_t most) {
  std::erase(backups, just_written);
  sort_backups(backups);
  std::error_code ignored;
  for (std::size_t i = 0; i + (most - 1) < backups.size(); ++i) fs::remove(backups[i], ignored);
}

}  // namespace booth::daemon

// One rosbag2 folder being written, whatever its messages are: topics, messages, and the metadata that ROS asks for.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "drivers/recording/sqlite.hpp"
#include "drivers/recording/staging.hpp"
#include "hal/time.hpp"

namespace booth::drivers {

/// A recording being made stands beside its final name; what it holds is safe, but for the last second, against a process that dies and a power cut:
/// messages go to the disk in transactions of a second. Not thread-safe. All members throw std::runtime_error naming the file and the reason.
class BagFile {
 public:
  /// `path` must not exist.
  explicit BagFile(const std::filesystem::path& path);

  std::size_t add_topic(const std::string& name, const std::string& type, bool latched);
  void insert(std::size_t topic, hal::UtcTime time, std::span<const char> message);
  /// Writes what was inserted since a second ago or more; to be called now and then.
  void commit_if_due();
  /// Takes back what the last transaction could not write (a full disk), so that close() can still make a whole bag of the rest.
  void give_up_last_transaction() noexcept;
  /// Metadata, everything to stable storage, and the final name.
  void close();

  const std::filesystem::path& folder() const { return staging_.folder(); }
  const std::filesystem::path& final_path() const { return staging_.final_path(); }
  std::uint64_t bytes() const { return bytes_; }
  bool empty() const { return messages_ == 0; }

 private:
  void execute(const char* sql);
  [[noreturn]] void fail() const;

  Staging staging_;
  std::filesystem::path file_;
  Database db_;
  Statement insert_;
  std::size_t topics_ = 0;
  std::uint64_t bytes_ = 0, messages_ = 0;
  std::chrono::steady_clock::time_point committed_;
};

/// Makes a whole bag of a folder that a dead process left behind (NAME.partial-XXXXXX), under the name NAME, or removes it where nothing is in it. Returns
/// the sentence to log. Never throws.
std::string recover_bag(const std::filesystem::path& partial) noexcept;
/// All of them in `directory`; one sentence each.
std::vector<std::string> recover_bags(const std::filesystem::path& directory);

}  // namespace booth::drivers

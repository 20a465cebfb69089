// A folder that appears under its name only when it is complete: written beside it, flushed, renamed.
#pragma once

#include <filesystem>

namespace booth::drivers {

class Staging {
 public:
  /// Throws std::runtime_error when `final_path` exists or its parent cannot be written.
  explicit Staging(std::filesystem::path final_path);

  const std::filesystem::path& folder() const { return folder_; }
  const std::filesystem::path& final_path() const { return final_path_; }
  /// Everything to stable storage, then the final name. Throws std::runtime_error.
  void publish();
  /// The same for a folder that another process left behind.
  static void adopt(const std::filesystem::path& folder, const std::filesystem::path& final_path) { Staging(folder, final_path).publish(); }

 private:
  Staging(std::filesystem::path folder, std::filesystem::path final_path) : final_path_(std::move(final_path)), folder_(std::move(folder)) {}
  std::filesystem::path final_path_, folder_;
};

}  // namespace booth::drivers

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

 private:
  std::filesystem::path final_path_, folder_;
};

}  // namespace booth::drivers

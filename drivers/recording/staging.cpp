// One syncfs for thousands of small files instead of an fsync each.
#include "drivers/recording/staging.hpp"

#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>

namespace booth::drivers {
namespace {

class Folder {
 public:
  explicit Folder(const std::filesystem::path& path) : fd_(open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {}
  ~Folder() {
    if (fd_ >= 0) close(fd_);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  bool flush_file_system() const { return fd_ >= 0 && syncfs(fd_) == 0; }
  bool flush() const { return fd_ >= 0 && fsync(fd_) == 0; }

 private:
  int fd_;
};

std::filesystem::path parent_of(const std::filesystem::path& p) { return p.has_parent_path() ? p.parent_path() : std::filesystem::path("."); }

}  // namespace

Staging::Staging(std::filesystem::path final_path) : final_path_(std::move(final_path)) {
  if (!final_path_.has_filename()) final_path_ = final_path_.parent_path();  // a trailing slash
  std::error_code ignored;
  if (std::filesystem::exists(final_path_, ignored))
    throw std::runtime_error("recording " + final_path_.string() + " exists already; name another one or remove it first");
  std::string pattern = final_path_.string() + ".partial-XXXXXX";
  if (mkdtemp(pattern.data()) == nullptr)
    throw std::runtime_error("cannot make a recording beside " + final_path_.string() + ": " + std::strerror(errno) +
                             "; check that the folder exists and may be written");
  folder_ = pattern;
}

void Staging::publish() {
  const auto fail = [&](const char* what) {
    throw std::runtime_error("cannot " + std::string(what) + " " + final_path_.string() + ": " + std::strerror(errno) + "; the data is in " + folder_.string());
  };
  if (!Folder(folder_).flush_file_system()) fail("flush recording");
  // A folder replaces nothing but an empty folder: a recording that came to lie here meanwhile is safe.
  if (std::rename(folder_.c_str(), final_path_.c_str()) != 0) fail("rename recording to");
  if (!Folder(parent_of(final_path_)).flush()) fail("flush the folder of");
  folder_ = final_path_;
}

}  // namespace booth::drivers

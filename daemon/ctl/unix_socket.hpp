// Unix stream sockets that carry lines.
#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <utility>

namespace booth::daemon {

/// Owns a file descriptor.
class UniqueFd {
 public:
  UniqueFd() = default;
  explicit UniqueFd(int fd) : fd_(fd) {}
  ~UniqueFd() { reset(); }
  UniqueFd(UniqueFd&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  UniqueFd& operator=(UniqueFd&& other) noexcept {
    if (this != &other) {
      reset();
      fd_ = std::exchange(other.fd_, -1);
    }
    return *this;
  }
  int get() const { return fd_; }
  explicit operator bool() const { return fd_ >= 0; }
  void reset();

 private:
  int fd_ = -1;
};

/// Listens at `path` with mode 0660; a socket that nobody listens on any more is replaced, and a missing folder is made.
/// Throws std::runtime_error naming the path, the reason and the remedy ("another boothd is running" ...).
UniqueFd listen_unix(const std::filesystem::path& path);

/// Throws std::runtime_error saying in one sentence why boothd cannot be reached.
UniqueFd connect_unix(const std::filesystem::path& path);

/// The whole text or nothing (false). Never raises SIGPIPE.
bool send_all(int fd, std::string_view text, std::chrono::milliseconds limit);

}  // namespace booth::daemon

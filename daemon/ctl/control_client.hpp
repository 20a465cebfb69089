// The control socket's end in boothctl: one request, one answer.
#pragma once

#include <chrono>
#include <filesystem>
#include <string>

#include "daemon/ctl/unix_socket.hpp"

namespace booth::daemon {

class ControlClient {
 public:
  /// Throws std::runtime_error as connect_unix().
  explicit ControlClient(const std::filesystem::path& path) : fd_(connect_unix(path)) {}

  /// Sends one line and returns the line that answers it. Throws std::runtime_error when boothd does not answer in time.
  std::string ask(const std::string& line, std::chrono::milliseconds limit = std::chrono::seconds(10));

 private:
  UniqueFd fd_;
  std::string pending_;
};

/// --socket, else control.socket of this machine's configuration; its default where that cannot be read.
std::filesystem::path control_socket_path(const std::string& given);

}  // namespace booth::daemon

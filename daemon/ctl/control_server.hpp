// The control socket's end in boothd: lines in, lines out, and nothing that a client does can hold the others up for long.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "daemon/ctl/unix_socket.hpp"

namespace booth::daemon {

/// Serves from construction to destruction on a thread of its own; removes the socket at the end.
class ControlServer {
 public:
  static constexpr std::size_t kLongestLine = 4096;  ///< bytes; a longer request is refused and its connection closed
  static constexpr std::size_t kMostClients = 16;    ///< further ones are told so and closed

  /// `answer` gets one line without its newline and returns one line (without). Throws as listen_unix().
  ControlServer(std::filesystem::path path, std::function<std::string(const std::string&)> answer);
  /// The same on a socket that listens already: whoever connected meanwhile is answered now.
  ControlServer(std::filesystem::path path, UniqueFd listener, std::function<std::string(const std::string&)> answer);
  ~ControlServer();
  ControlServer(const ControlServer&) = delete;

 private:
  struct Client {
    UniqueFd fd;
    std::string pending;
  };
  void serve();
  void accept_client();
  /// False when the connection is at its end.
  bool read_client(Client& client);

  std::filesystem::path path_;
  std::function<std::string(const std::string&)> answer_;
  UniqueFd listener_, wake_;
  std::vector<Client> clients_;
  std::thread thread_;
};

}  // namespace booth::daemon

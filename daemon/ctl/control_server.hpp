// The control socket's end in boothd: lines in, lines out, and nothing that a client does can hold the others up for long.
#pragma once

#include <chrono>
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
  static constexpr std::size_t kLongestLine = 4096;             ///< bytes; a longer request is refused and its connection closed
  static constexpr std::size_t kMostClients = 16;               ///< further ones are told so and closed, unless one of these ...
  static constexpr std::chrono::milliseconds kSilence{10'000};  ///< ... has said nothing for so long: it makes room

  /// `answer` gets one line without its newline and returns one line (without). Throws as listen_unix().
  ControlServer(std::filesystem::path path, std::function<std::string(const std::string&)> answer);
  /// The same on a socket that listens already: whoever connected meanwhile is answered now.
  ControlServer(std::filesystem::path path, UniqueFd listener, std::function<std::string(const std::string&)> answer,
                std::chrono::milliseconds silence = kSilence);
  ~ControlServer();
  ControlServer(const ControlServer&) = delete;

 private:
  struct Client {
    UniqueFd fd;
    std::string pending;
    std::chrono::steady_clock::time_point heard = std::chrono::steady_clock::now();
  };
  void serve();
  void accept_client();
  /// Of a full house the one that was silent for longest goes, if that was long; false: all of them talk.
  bool make_room();
  /// False when the connection is at its end.
  bool read_client(Client& client);

  std::filesystem::path path_;
  std::function<std::string(const std::string&)> answer_;
  const std::chrono::milliseconds silence_;
  UniqueFd listener_, wake_;
  std::vector<Client> clients_;
  bool deaf_ = false;  ///< there is no descriptor for one more client: who knocks waits a moment
  std::thread thread_;
};

}  // namespace booth::daemon

// The other end of booth/command: asks one booth to do something and waits for its answer, as docs/guide/subscribe.md tells others to.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "daemon/dds/command_guard.hpp"
#include "daemon/dds/dds_settings.hpp"

namespace booth::daemon {

struct CommandAnswer {
  bool accepted = false;
  std::uint8_t state = 0;  ///< SessionState after the command
  std::string text;        ///< why it was refused
};

/// Not thread-safe.
class CommandClient {
 public:
  /// `settings.booth` is the booth to command. Throws std::runtime_error naming what DDS refused; under DDS Security that may be the right to command.
  explicit CommandClient(const DdsSettings& settings);
  ~CommandClient();
  CommandClient(const CommandClient&) = delete;

  /// Sends the command, and again the same every second, until it is answered. Throws std::runtime_error when `limit` has passed: what was missing, the booth
  /// or its answer.
  CommandAnswer send(DdsCommand command, std::chrono::milliseconds limit);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace booth::daemon

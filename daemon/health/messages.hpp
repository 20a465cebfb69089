// The messages that an operator acts upon, each with an id that never changes, so that monitoring need not read sentences.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "daemon/health/log.hpp"

namespace booth::daemon {

enum class Message : std::uint8_t {
  ready,
  stopping,
  configuration_wrong,
  start_failed,
  internal_fault,
  thread_stalled,
  camera_changed,
  camera_lost,
  camera_moved,
  backend_changed,
  panel_problem,
  credentials_expire,
  session_began,
  session_complete,
  session_not_saved,
  system_call_refused,
  given_up,
  newer_file,
};

struct MessageEntry {
  Message message;
  std::string_view id;  ///< 32 hexadecimal digits, as systemd's MESSAGE_ID; made at random once, never used for another meaning
  std::string_view name, meaning, remedy;
};

/// In the order of the enumeration.
std::span<const MessageEntry> messages();
const MessageEntry& entry_of(Message message);

/// As log_line(); where stderr goes to the journal, with MESSAGE_ID (datagrams of systemd's native protocol, JOURNAL_NATIVE_PROTOCOL). Where the journal does
/// not take it, the line goes to stderr. Thread-safe.
void log_message(LogLevel level, Message message, std::string_view text);

/// As log_message(), for what is said right before the process ends: returns when the journal has taken it, after two seconds at the latest. journald learns
/// from the living process to which unit a message belongs; of one that has ended already `journalctl -u boothd` would not show it. Never in the frame loop.
void log_last_message(LogLevel level, Message message, std::string_view text);

/// From now on log_message() sends to this socket; empty: to stderr only. Without it /run/systemd/journal/socket where systemd's JOURNAL_STREAM names stderr.
void set_journal(const std::filesystem::path& socket);

/// docs/reference/messages.md.
std::string messages_page();

}  // namespace booth::daemon

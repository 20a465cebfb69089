// Logging by single write() calls, or single datagrams to the journal: lines of several threads do not mix.
#include "daemon/health/log.hpp"

#include <errno.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string>

#include "daemon/health/messages.hpp"

namespace booth::daemon {
namespace {

std::atomic<LogLevel> g_level{LogLevel::info};

/// systemd sets JOURNAL_STREAM for services whose stderr goes to the journal; a child whose stderr was led elsewhere inherits the variable, too.
std::string journal_of_this_process() {
  const char* stream = std::getenv("JOURNAL_STREAM");
  struct stat s {};
  if (stream == nullptr || ::fstat(STDERR_FILENO, &s) != 0) return {};
  return std::to_string(s.st_dev) + ":" + std::to_string(s.st_ino) == stream ? "/run/systemd/journal/socket" : "";
}

struct Journal {
  std::mutex mutex;
  std::string socket = journal_of_this_process();
};
Journal& journal() {
  static Journal it;
  return it;
}

/// Control characters become spaces: no line can be forged, and no field of a datagram.
std::string plain(std::string_view text) {
  std::string out(text);
  for (char& c : out)
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  return out;
}

/// False when nobody took it. A socket for each: messages are rare, and one that was opened before journald was restarted would be of no use.
bool send_datagram(const std::string& path, const std::string& bytes) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path) return false;
  std::memcpy(address.sun_path, path.data(), path.size());
  const int fd = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return false;
  const auto sent = ::sendto(fd, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  ::close(fd);
  return sent == static_cast<ssize_t>(bytes.size());
}

}  // namespace

void set_log_level(LogLevel least_important) { g_level = least_important; }

LogLevel log_level_by_name(std::string_view name) {
  return name == "error" ? LogLevel::error : name == "warning" ? LogLevel::warning : name == "debug" ? LogLevel::debug : LogLevel::info;
}

void log_line(LogLevel level, std::string_view text) {
  if (level > g_level.load()) return;
  // In the journal "<N>" is the line's priority.
  static const bool in_journal = std::getenv("JOURNAL_STREAM") != nullptr;
  std::string line = in_journal                   ? "<" + std::to_string(static_cast<int>(level)) + ">"
                     : level == LogLevel::error   ? "error: "
                     : level == LogLevel::warning ? "warning: "
                                                  : "";
  line += plain(text) + '\n';
  if (::write(STDERR_FILENO, line.data(), line.size()) < 0) return;  // nowhere left to complain
}

void log_message(LogLevel level, Message message, std::string_view text) {
  if (level > g_level.load()) return;
  std::string socket;
  {
    const std::lock_guard lock(journal().mutex);
    socket = journal().socket;
  }
  if (!socket.empty() && send_datagram(socket, "MESSAGE=" + plain(text) + "\nMESSAGE_ID=" + std::string(entry_of(message).id) + "\nPRIORITY=" +
                                                   std::to_string(static_cast<int>(level)) + "\nSYSLOG_IDENTIFIER=" + program_invocation_short_name + "\n"))
    return;
  log_line(level, text);
}

void set_journal(const std::filesystem::path& socket) {
  const std::lock_guard lock(journal().mutex);
  journal().socket = socket.string();
}

}  // namespace booth::daemon

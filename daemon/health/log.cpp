// Logging by single write() calls, or single datagrams to the journal: lines of several threads do not mix.
#include "daemon/health/log.hpp"

#include <errno.h>
#include <linux/sockios.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string>
#include <thread>

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

/// Until the receiver has taken what was sent here, two seconds at most; and a moment more, in which it looks who the sender is.
void wait_until_taken(int fd) {
  using namespace std::chrono_literals;
  const auto until = std::chrono::steady_clock::now() + 2s;
  int bytes = 0;
  while (::ioctl(fd, SIOCOUTQ, &bytes) == 0 && bytes > 0 && std::chrono::steady_clock::now() < until) std::this_thread::sleep_for(5ms);
  std::this_thread::sleep_for(20ms);
}

enum class Then { go_on, wait };

/// False when nobody took it. A socket for each: messages are rare, and one that was opened before journald was restarted would be of no use.
bool send_datagram(const std::string& path, const std::string& bytes, Then then) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path) return false;
  std::memcpy(address.sun_path, path.data(), path.size());
  const int fd = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return false;
  const auto sent = ::sendto(fd, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  const bool whole = sent == static_cast<ssize_t>(bytes.size());
  if (whole && then == Then::wait) wait_until_taken(fd);
  ::close(fd);
  return whole;
}

void log_with_id(LogLevel level, Message message, std::string_view text, Then then) {
  if (level > g_level.load()) return;
  std::string socket;
  {
    const std::lock_guard lock(journal().mutex);
    socket = journal().socket;
  }
  if (!socket.empty() && send_datagram(socket,
                                       "MESSAGE=" + plain(text) + "\nMESSAGE_ID=" + std::string(entry_of(message).id) + "\nPRIORITY=" +
                                           std::to_string(static_cast<int>(level)) + "\nSYSLOG_IDENTIFIER=" + program_invocation_short_name + "\n",
                                       then))
    return;
  log_line(level, text);
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

void log_message(LogLevel level, Message message, std::string_view text) { log_with_id(level, message, text, Then::go_on); }

void log_last_message(LogLevel level, Message message, std::string_view text) { log_with_id(level, message, text, Then::wait); }

void set_journal(const std::filesystem::path& socket) {
  const std::lock_guard lock(journal().mutex);
  journal().socket = socket.string();
}

}  // namespace booth::daemon

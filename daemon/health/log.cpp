// Logging by single write() calls: lines of several threads do not mix.
#include "daemon/health/log.hpp"

#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <string>

namespace booth::daemon {
namespace {
std::atomic<LogLevel> g_level{LogLevel::info};
}

void set_log_level(LogLevel least_important) { g_level = least_important; }

LogLevel log_level_by_name(std::string_view name) {
  return name == "error" ? LogLevel::error : name == "warning" ? LogLevel::warning : name == "debug" ? LogLevel::debug : LogLevel::info;
}

void log_line(LogLevel level, std::string_view text) {
  if (level > g_level.load()) return;
  // systemd sets JOURNAL_STREAM for services whose stderr goes to the journal; there "<N>" is the line's priority.
  static const bool journal = std::getenv("JOURNAL_STREAM") != nullptr;
  std::string line = journal                      ? "<" + std::to_string(static_cast<int>(level)) + ">"
                     : level == LogLevel::error   ? "error: "
                     : level == LogLevel::warning ? "warning: "
                                                  : "";
  for (const char c : text) line += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  line += '\n';
  if (::write(STDERR_FILENO, line.data(), line.size()) < 0) return;  // nowhere left to complain
}

}  // namespace booth::daemon

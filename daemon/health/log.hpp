// One line to stderr for each thing worth knowing, with the journal's priority when systemd listens.
#pragma once

#include <string_view>

namespace booth::daemon {

enum class LogLevel : int { error = 3, warning = 4, info = 6, debug = 7 };  ///< syslog's numbers

/// Messages less important than this are not written. Thread-safe, as is log_line().
void set_log_level(LogLevel least_important);
LogLevel log_level_by_name(std::string_view name);

/// One line; control characters in the text are replaced, so that a device's name cannot forge lines.
void log_line(LogLevel level, std::string_view text);

}  // namespace booth::daemon

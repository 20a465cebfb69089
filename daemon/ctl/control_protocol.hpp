// What the lines on the control socket mean (docs/reference/control-socket.md).
#pragma once

#include <string>

#include "daemon/session/controller.hpp"

namespace booth::daemon {

/// Everything that `boothctl status --json` prints, one line.
std::string status_json(const DaemonStatus& status);

/// Answers one request; whatever the line holds, the answer is one JSON object with `ok`. Thread-safe; never throws for bad input.
std::string answer_request(const std::string& line, Controller& controller);

}  // namespace booth::daemon

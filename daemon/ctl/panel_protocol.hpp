// What the control socket answers about a simulated panel: presses of its buttons, and what its lamps did.
#pragma once

#include <optional>
#include <string>

#include "daemon/drivers_factory.gpio.hpp"

namespace booth::daemon {

/// The answer to "press" and "lamp" (docs/reference/control-socket.md); nothing for any other request. `visitor` is null where the panel is no simulated
/// one. Never throws for what the line holds.
std::optional<std::string> answer_panel_request(const std::string& line, SimulatedVisitor* visitor);

}  // namespace booth::daemon

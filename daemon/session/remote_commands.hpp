// What a command from the network does in this booth: the one place where commands of DDS become events of the session.
#pragma once

#include "daemon/dds/dds_link.hpp"
#include "daemon/session/controller.hpp"

namespace booth::daemon {

/// Waits for the controller's answer. `calibrate` and `snapshot` are refused with a sentence: this version has neither.
DdsAnswer answer_remote_command(DdsCommand command, Controller& controller);

}  // namespace booth::daemon

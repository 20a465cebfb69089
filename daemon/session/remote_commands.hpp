// What a command from the network does in this booth: the one place where commands of DDS become events of the session.
#pragma once

#include "daemon/dds/dds_link.hpp"
#include "daemon/session/controller.hpp"
#include "hal/flight_recorder.hpp"

namespace booth::daemon {

/// Waits for the controller's answer; a snapshot is accepted when it begins to be written, a calibration when it begins: what comes of it is
/// told on booth/event.
DdsAnswer answer_remote_command(DdsCommand command, Controller& controller, hal::FlightRecorder& recorder);

}  // namespace booth::daemon

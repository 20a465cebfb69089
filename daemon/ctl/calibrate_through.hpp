// The calibration that a running boothd makes, followed on a terminal.
#pragma once

#include <string>

namespace booth::daemon {

/// Asks boothd at this control socket to calibrate and says line by line how far it is, until it has ended; Ctrl-C stops it. False when no boothd is there;
/// then nothing was done. Throws VerbFailure with boothd's sentence when it refuses or the result is not stored.
bool calibrate_through_boothd(const std::string& socket, bool json);

}  // namespace booth::daemon

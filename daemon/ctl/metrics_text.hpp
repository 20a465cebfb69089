// The status as numbers that Prometheus reads.
#pragma once

#include <string>

#include "daemon/ctl/status_reading.hpp"

namespace booth::daemon {

/// Prometheus' text exposition format, version 0.0.4: what `boothctl status --json` knows as numbers, in base units (seconds, bytes, metres), names beginning
/// with `boothd_`. Null: boothd does not answer, and all that is known is `boothd_up 0`. Nothing in it names a session or a person.
std::string metrics_text(const StatusJson& status);

}  // namespace booth::daemon

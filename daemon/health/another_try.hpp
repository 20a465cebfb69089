// What a supervised boothd does when something is missing that it cannot start without, and that may come: a sensor, a clock that is set.
#pragma once

#include <signal.h>

#include "daemon/config/load.hpp"

namespace booth::daemon {

/// Waits before boothd ends and is started again: as long as the machine has run, at most 20 s, so that the starts never reach the unit's limit (20 in 300 s),
/// which is for what no further try mends. The light says meanwhile that boothd has failed. False when `signals`, which must be blocked, told to end.
bool pause_before_another_try(const ConfigSources& sources, const sigset_t& signals);

}  // namespace booth::daemon

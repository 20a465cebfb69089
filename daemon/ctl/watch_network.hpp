// Live skeletons of booths on the network, for people: figures side by side on a terminal, lines in a pipe.
#pragma once

#include <map>
#include <string>

#include "daemon/dds/booth_listener.hpp"

namespace booth::daemon {

struct NetworkWatch {
  DdsSettings settings;
  double seconds = 0;  ///< 0: until interrupted
  bool json = false;   ///< one JSON object for each booth and skeleton
};

void watch_network(const NetworkWatch& watch);

/// Figures of as many booths as fit side by side into `columns`, each under its name and state.
std::string fleet_figures(const std::map<std::string, HeardBooth>& booths, int columns, int rows);

}  // namespace booth::daemon

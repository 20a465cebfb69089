// Which booths there are and which of them are unwell, from what was heard; as a table or as JSON.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "daemon/dds/booth_listener.hpp"

namespace booth::daemon {

struct FleetRow {
  std::string id;
  std::string state;                  ///< as boothctl status says it, or "gone", "missing"
  std::vector<std::string> reasons;   ///< why it is unwell; empty: it is well
  const HeardBooth* heard = nullptr;  ///< null for a booth that was expected and not heard
};

/// Booths in the order of their names; those of `expected` that were not heard are rows, too. The rows point into `booths`.
std::vector<FleetRow> fleet_rows(const std::map<std::string, HeardBooth>& booths, const std::vector<std::string>& expected);

/// Safe for a terminal whatever the network has sent.
std::string fleet_table(const std::vector<FleetRow>& rows);
std::string fleet_json(const std::vector<FleetRow>& rows);
int unwell(const std::vector<FleetRow>& rows);

}  // namespace booth::daemon

// boothctl calibrate --from-person: cameras put right by a recording of somebody who moves before them.
#pragma once

#include <filesystem>
#include <string>

#include "daemon/config/config.hpp"

namespace booth::daemon {

struct FromPerson {
  std::string recording;
  std::filesystem::path file;  ///< the calibration to refine; may be empty with `dry_run`: then the places that the recording knows are judged
  Config config;               ///< models, stage and fit
  std::string utc, by;         ///< for the record
  bool dry_run = false, json = false;
};

/// Says what was found, stores it where it is better. Throws VerbFailure where it is not, or nothing could be found.
void calibrate_from_person(const FromPerson& task);

}  // namespace booth::daemon

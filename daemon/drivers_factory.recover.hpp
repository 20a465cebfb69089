// The steps on USB that need root: taken here for a process that may, asked for there by one that may not.
#pragma once

#include <string>

namespace booth::daemon {

/// What came of a step, and how it should be told.
struct RecoverReport {
  bool known = false;   ///< the step's name is one
  bool failed = false;  ///< permitted and sensible, and yet it did not work
  std::string sentence;
};

/// Answers the request for `step` that lies in the folder `requests`, into the folder `answers` (drivers/usb/recover_request.hpp).
RecoverReport answer_recover_step(const std::string& step, const std::string& requests, const std::string& answers);

}  // namespace booth::daemon

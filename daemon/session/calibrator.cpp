// Words of an outcome.
#include "daemon/session/calibrator.hpp"

namespace booth::daemon {

const char* to_string(CalibrationStatus::Outcome outcome) {
  using Outcome = CalibrationStatus::Outcome;
  switch (outcome) {
    case Outcome::none:
      return "none";
    case Outcome::stored:
      return "stored";
    case Outcome::refused:
      return "refused";
    case Outcome::cancelled:
      return "cancelled";
    case Outcome::failed:
      return "failed";
  }
  return "unknown";
}

}  // namespace booth::daemon

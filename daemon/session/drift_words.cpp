// Sentences that name the camera first.
#include "daemon/session/drift_words.hpp"

#include <fmt/format.h>

namespace booth::daemon {

using Verdict = CameraDriftStatus::Verdict;

bool off_its_place(Verdict verdict) { return verdict == Verdict::moved || verdict == Verdict::blind; }

std::string drift_sentence(const std::string& name, const CameraDriftStatus& camera) {
  switch (camera.verdict) {
    case Verdict::unknown:
      return fmt::format("camera {}: too little was seen to tell whether it stands where the calibration says", name);
    case Verdict::stands:
      return fmt::format("camera {} stands where the calibration says", name);
    case Verdict::moved:
      return fmt::format("camera {}{} has moved: its points of a person are {:.0f} mm off; fasten it and calibrate again", name,
                         camera.one_of_two ? " or the one opposite" : "", 1e3 * camera.displacement * (camera.one_of_two ? 2 : 1));
    case Verdict::blind:
      return fmt::format("camera {} sees nothing where the others see a person: it was turned away or is covered; aim it and calibrate again", name);
  }
  return name;
}

}  // namespace booth::daemon

// Tells from a session's frames when a body has been accepted that is not the one before.
#pragma once

#include <algorithm>
#include <cmath>

#include "daemon/pipeline/frame_record.hpp"

namespace booth::daemon {

/// Hears the frames of one session in their order. Allocates nothing; not thread-safe.
class AcceptedBody {
 public:
  /// Standard deviations: a body that differs by less in every coefficient is the same one. About a centimetre of stature, and less than two people differ by.
  static constexpr double kAlike = 0.1;

  /// True where body_accepted has just risen, for a body that is not the one told last. It falls and rises with the same person, too: preset paper estimates
  /// anew whomever it has lost for a moment. Whose shape and sex are (nearly) what was told last is that person, and is not told again.
  bool another(const FrameRecord& frame) {
    if (frame.person == PersonState::lost) return false;  // whatever stands there is of nobody
    const bool risen = frame.body_accepted != 0 && !accepted_;
    accepted_ = frame.body_accepted != 0;
    if (!risen || (known_ && is_told(frame))) return false;
    known_ = true;
    sex_ = frame.sex;
    count_ = frame.shape_count;
    beta_ = frame.beta;
    return true;
  }

 private:
  bool is_told(const FrameRecord& frame) const {
    if (frame.sex != sex_ || frame.shape_count != count_) return false;
    return std::equal(beta_.begin(), beta_.begin() + count_, frame.beta.begin(), [](double a, double b) { return std::abs(a - b) < kAlike; });
  }

  bool accepted_ = false, known_ = false;
  RecordSex sex_ = RecordSex::men;
  std::uint8_t count_ = 0;
  std::array<double, kRecordShape> beta_{};
};

}  // namespace booth::daemon

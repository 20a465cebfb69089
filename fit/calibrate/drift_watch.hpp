// Notices, while people are captured, that a camera does not stand any more where the calibration says.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "fit/calibrate/person_system.hpp"

namespace booth::fit::calibrate {

/// How they were chosen: docs/design/drift.md.
struct DriftLimits {
  double displacement = 0.006;  ///< metres that a camera's points of a person are off, root mean square
  double deviations = 2.5;      ///< and so many of its standard deviations
  double share = 0.35;          ///< and so much of what the camera is off that is off most
  double missed = 0.7;          ///< share of moments in which a camera saw nothing of the person: it looks elsewhere
  double memory = 7;            ///< seconds of followed motion after which a look weighs 1/e
  double evidence = 6;          ///< seconds of followed motion before anything is said
  double between = 1;           ///< seconds between two judgements
  int confirmed = 3;            ///< judgements in a row until a camera is said to have moved
  double cleared = 0.6;         ///< share of the limit below which, as often in a row, it is said to stand right again
};

enum class CameraVerdict : std::uint8_t {
  unknown,  ///< too little was seen
  stands,   ///< where the calibration says
  moved,    ///< stands elsewhere
  blind,    ///< sees nothing where the others see the person: turned away or covered
};

struct CameraDrift {
  CameraVerdict verdict = CameraVerdict::unknown;
  CameraSays says;
  int over = 0, under = 0;  ///< judgements in a row
};

/// Allocates in the constructor only. One thread at a time.
class DriftWatch {
 public:
  /// Throws as PersonSystem.
  DriftWatch(std::shared_ptr<const BodyModel> men, std::shared_ptr<const BodyModel> women, const PersonSystemSettings& settings,
             const DriftLimits& limits = {});

  /// One fitted frame. True when the cameras were judged anew.
  bool observe(const Observation& observation, const FitResult& result);
  /// A new session: somebody else may come. What is known of the cameras stays.
  void new_person();

  const CameraDrift& camera(int i) const { return cameras_[static_cast<std::size_t>(i)]; }
  int cameras() const { return count_; }
  /// Only two cameras have seen people: that they disagree is known, but not which of them has moved.
  bool ambiguous() const { return ambiguous_; }
  std::size_t memory_bytes() const { return sizeof(*this) - sizeof(system_) + system_.memory_bytes(); }

 private:
  void judge();
  const DriftLimits limits_;
  const int count_;
  PersonSystem system_;
  std::array<CameraDrift, PersonSystemSettings::kMostCameras> cameras_{};
  double last_time_ = 0, followed_ = 0, since_judged_ = 0;
  bool have_last_ = false, ambiguous_ = false;
};

}  // namespace booth::fit::calibrate

// Forgets slowly, judges every second, says nothing before it has been said three times.
#include "fit/calibrate/drift_watch.hpp"

#include <algorithm>
#include <cmath>

namespace booth::fit::calibrate {

DriftWatch::DriftWatch(std::shared_ptr<const BodyModel> men, std::shared_ptr<const BodyModel> women, const PersonSystemSettings& settings,
                       const DriftLimits& limits)
    : limits_(limits), count_(settings.cameras), system_(std::move(men), std::move(women), settings) {}

void DriftWatch::new_person() {
  system_.new_person();
  have_last_ = false;
}

bool DriftWatch::observe(const Observation& observation, const FitResult& result) {
  if (!system_.observe(observation, result)) return false;
  // Moments are further apart than frames, but of one stretch of followed motion when less than half a second lies between them.
  constexpr double kStretch = 0.5;
  const double dt = observation.time - last_time_;
  const double passed = have_last_ && dt > 0 && dt < kStretch ? dt : 0;
  last_time_ = observation.time;
  have_last_ = true;
  system_.forget(std::exp(-passed / limits_.memory));
  followed_ += passed;
  since_judged_ += passed;
  if (since_judged_ < limits_.between) return false;
  since_judged_ = 0;
  judge();
  return true;
}

void DriftWatch::judge() {
  system_.solve();
  int heard = 0, seeing = 0;
  double most = 0;
  for (int c = 0; c < count_; ++c) {
    const CameraSays& says = system_.cameras()[static_cast<std::size_t>(c)];
    heard += says.deviation > 0;
    most = std::max(most, says.displacement);
    seeing += says.moments > 0 && says.missed < 1 - limits_.missed;
  }
  ambiguous_ = heard == 2;
  for (int c = 0; c < count_; ++c) {
    CameraDrift& camera = cameras_[static_cast<std::size_t>(c)];
    camera.says = system_.cameras()[static_cast<std::size_t>(c)];
    const CameraSays& says = camera.says;
    if (followed_ < limits_.evidence) continue;
    const bool blind = says.missed > limits_.missed && seeing >= 2;
    const bool known = says.deviation > 0;
    // Of two cameras each is given half of what they disagree by.
    const double displacement = ambiguous_ ? 2 * says.displacement : says.displacement;
    // One that is far off pulls the body, and so the others, out of place: a small part of it is not their own.
    const bool own = says.displacement > limits_.share * most;
    const bool over = blind || (known && own && displacement > limits_.displacement && displacement > limits_.deviations * says.deviation);
    const bool under = !blind && known && displacement < limits_.cleared * limits_.displacement;
    camera.over = over ? camera.over + 1 : 0;
    camera.under = under ? camera.under + 1 : 0;
    if (camera.over >= limits_.confirmed) camera.verdict = blind ? CameraVerdict::blind : CameraVerdict::moved;
    const bool alarmed = camera.verdict == CameraVerdict::moved || camera.verdict == CameraVerdict::blind;
    if (!alarmed && known) camera.verdict = CameraVerdict::stands;
    if (alarmed && camera.under >= limits_.confirmed) camera.verdict = CameraVerdict::stands;
  }
}

}  // namespace booth::fit::calibrate

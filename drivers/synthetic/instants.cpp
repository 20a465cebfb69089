// Phase and jitter from a hash of (seed, camera, frame).
#include "drivers/synthetic/instants.hpp"

#include <algorithm>

#include "drivers/synthetic/mix.hpp"

namespace booth::drivers {
namespace {

/// The next number of SplitMix64 from the state `x`.
std::uint64_t next(std::uint64_t x) { return mix(x + 0x9e3779b97f4a7c15ull); }

/// In [0, 1).
double uniform(std::uint64_t bits) { return static_cast<double>(bits >> 11) * 0x1p-53; }

}  // namespace

hal::Nanoseconds frame_period(const hal::CameraDescription& camera) { return hal::from_seconds(1 / camera.nominal_rate); }

Instants::Instants(const SceneSettings& settings, int camera)
    : period_(1 / settings.cameras[static_cast<std::size_t>(camera)].nominal_rate),
      jitter_(std::min(settings.jitter, period_ / 8)),
      key_(next(next(settings.seed) ^ static_cast<std::uint64_t>(camera))) {
  phase_ = uniform(next(key_)) * settings.phase_spread + 3 * jitter_;  // never before scene time zero
}

hal::Nanoseconds Instants::at(std::uint64_t k) const {
  // Four uniform numbers make a bell with a bound: neighbours never swap.
  double sum = 0;
  std::uint64_t bits = next(key_ + 1 + k);
  for (int i = 0; i < 4; ++i, bits = next(bits)) sum += uniform(bits) - 0.5;
  const double jitter = std::clamp(sum * 1.7320508075688772, -3.0, 3.0) * jitter_;
  return hal::from_seconds(phase_ + static_cast<double>(k) * period_ + jitter);
}

}  // namespace booth::drivers

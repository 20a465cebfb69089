// When a simulated camera takes its frames: a period, a phase of its own and a little jitter, all keyed by the seed.
#pragma once

#include <cstdint>

#include "drivers/synthetic/scene.hpp"
#include "hal/time.hpp"

namespace booth::drivers {

hal::Nanoseconds frame_period(const hal::CameraDescription& camera);

/// Pure function of (settings, camera, frame). Thread-safe.
class Instants {
 public:
  Instants(const SceneSettings& settings, int camera);
  /// Scene time of frame k; strictly increasing.
  hal::Nanoseconds at(std::uint64_t k) const;

 private:
  double period_, phase_, jitter_;
  std::uint64_t key_;
};

}  // namespace booth::drivers

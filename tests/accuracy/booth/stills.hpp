// Bodies that stand still before the four simulated cameras, and what the estimator gets to see of them.
#pragma once

#include <vector>

#include "drivers/synthetic/noise.hpp"
#include "fit/cloud/cloud_builder.hpp"
#include "hal/depth_frame.hpp"
#include "tests/accuracy/booth/subjects.hpp"

namespace booth::accuracy {

inline constexpr int kCameras = 4;
inline constexpr int kCloudCapacity = 120000;
inline constexpr unsigned kAllCameras = 0xF;

/// Images of one body in several poses, all cameras at one instant.
struct Stills {
  std::vector<std::vector<hal::DepthFrame>> frames;  ///< [pose][camera]
  std::vector<hal::DepthFrame> background;           ///< of the empty room, with the same noise
};
Stills render_stills(const Subject& subject, const std::vector<fit::PoseVector>& poses, const drivers::NoiseModel& noise, std::uint64_t seed);

/// Images to observations, by the same builder as in the daemon. One thread calls at a time.
class Booth {
 public:
  Booth();
  /// The observation of one pose as `cameras` (a bit each) saw it; it belongs to the Booth and holds until the next call. Its cloud is empty when nobody was
  /// seen.
  const fit::Observation& look(const Stills& stills, std::size_t pose, unsigned cameras = kAllCameras);

 private:
  fit::CloudBuilder builder_;
  fit::Observation observation_;
};

}  // namespace booth::accuracy

// What a time-of-flight camera does to the true depth, as numbers keyed by (seed, camera, frame, pixel).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace booth::drivers {

struct NoiseModel {
  enum class Kind : std::uint8_t { none, gaussian, kinect2 };
  Kind kind = Kind::kinect2;
  double sigma = 0;  ///< metres; gaussian only

  /// "none", "kinect2" or "gaussian:SIGMA" with SIGMA in metres, 0 to 1. Throws std::invalid_argument.
  static NoiseModel parse(std::string_view text);
  std::string to_string() const;
};

}  // namespace booth::drivers

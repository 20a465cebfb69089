// What a simulated scene or an annotated recording knows of the person, so that error figures can be made where the truth is known.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "hal/time.hpp"

namespace booth::hal {

inline constexpr int kTruthDofs = 36;
inline constexpr int kTruthJoints = 24;

/// Joints in the order of ARCHITECTURE's 24 points (docs/reference/skeleton.md), booth frame, metres; q in the CMU frame.
struct TruthSample {
  std::array<double, kTruthDofs> q{};
  std::array<std::array<double, 3>, kTruthJoints> joints{};
};

/// Thread-safe for concurrent const calls.
class GroundTruth {
 public:
  virtual ~GroundTruth() = default;
  virtual std::string body_name() const = 0;  ///< e.g. "test:7"
  virtual std::string sex() const = 0;        ///< "men" or "women"
  /// The truth at an instant; nothing outside the source's time span or when nobody is there.
  virtual std::optional<TruthSample> at(MonotonicTime t) const = 0;
  /// The true posed surface at an instant, booth frame, metres; empty when not known.
  virtual std::vector<std::array<float, 3>> surface(MonotonicTime t) const = 0;
  virtual const std::vector<std::array<int, 3>>& faces() const = 0;
};

}  // namespace booth::hal

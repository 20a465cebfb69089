// A device's free-running tick counter, mapped to the host's clock by the packets that were delayed least.
#pragma once

#include <array>
#include <cstdint>

#include "hal/time.hpp"

namespace booth::drivers::kinect2 {

/// A line below (arrival - device time): arrivals are late by varying amounts and never early, so the lowest of each stretch of time tell the clocks' offset
/// and, over minutes, their drift (crystals differ by up to 200 ppm). Fixed memory; not thread-safe.
class DeviceTime {
 public:
  /// `delay`: from the middle of the exposure to the arrival of an undelayed frame.
  explicit DeviceTime(hal::Nanoseconds delay = std::chrono::milliseconds(30)) : delay_(delay) {}

  /// Ticks of 0.125 ms, wrapping at 2^32. Never after `arrived`, and always after what was returned before. A jump of the device's clock, of half a second
  /// against the host's or more at once, of 50 ms or more after half a second of frames that all say so, begins a new line.
  hal::MonotonicTime to_host(std::uint32_t ticks, hal::MonotonicTime arrived);
  /// For a device that may count anew; what is returned goes on to grow.
  void reset();
  double drift_ppm() const { return 1e6 * slope_; }
  int jumps() const { return jumps_; }

 private:
  void begin(std::uint32_t ticks, hal::MonotonicTime arrived);
  void close_stretch();

  static constexpr int kStretches = 30;
  struct Lowest {
    double device, offset;  // seconds since begin(); arrival - device time at the stretch's lowest
  };
  hal::Nanoseconds delay_;
  bool begun_ = false;
  std::uint32_t last_ticks_ = 0;
  std::int64_t ticks_ = 0;
  hal::MonotonicTime origin_{}, last_{hal::MonotonicTime::min()};
  std::array<Lowest, kStretches> lowest_{};
  int stretches_ = 0, next_ = 0, jumps_ = 0, late_ = 0;
  Lowest current_{};
  double stretch_began_ = 0;
  double slope_ = 0, base_ = 0, base_at_ = 0;
};

}  // namespace booth::drivers::kinect2

// The lower envelope, as a line through the lowest offsets of the last half minute.
#include "drivers/kinect2/device_time.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/kinect2/layout.hpp"

namespace booth::drivers::kinect2 {
namespace {

constexpr double kStretch = 1.0;      // seconds
constexpr double kJump = 0.5;         // seconds
constexpr double kLate = 0.05;        // seconds
constexpr int kLateInARow = 15;       // frames; no load of the host delays so many by so much and none by less
constexpr double kSteepest = 500e-6;  // beyond any crystal: a fit that says so has too little to go by
constexpr int kEnoughForSlope = 8;    // stretches

}  // namespace

void DeviceTime::begin(std::uint32_t ticks, hal::MonotonicTime arrived) {
  begun_ = true;
  last_ticks_ = ticks;
  ticks_ = 0;
  origin_ = arrived;
  stretches_ = next_ = 0;
  current_ = {0, 0};
  stretch_began_ = slope_ = base_ = base_at_ = 0;
  late_ = 0;
}

void DeviceTime::close_stretch() {
  lowest_[static_cast<std::size_t>(next_)] = current_;
  next_ = (next_ + 1) % kStretches;
  stretches_ = std::min(stretches_ + 1, kStretches);
  // Least squares for the drift, then the line is lowered until no point lies beneath it.
  double mean_d = 0, mean_o = 0;
  for (int i = 0; i < stretches_; ++i) mean_d += lowest_[static_cast<std::size_t>(i)].device, mean_o += lowest_[static_cast<std::size_t>(i)].offset;
  mean_d /= stretches_, mean_o /= stretches_;
  double num = 0, den = 0;
  for (int i = 0; i < stretches_; ++i) {
    const Lowest& l = lowest_[static_cast<std::size_t>(i)];
    num += (l.device - mean_d) * (l.offset - mean_o);
    den += (l.device - mean_d) * (l.device - mean_d);
  }
  slope_ = stretches_ >= kEnoughForSlope && den > 0 ? std::clamp(num / den, -kSteepest, kSteepest) : 0;
  base_at_ = mean_d;
  base_ = mean_o;
  for (int i = 0; i < stretches_; ++i) {
    const Lowest& l = lowest_[static_cast<std::size_t>(i)];
    base_ = std::min(base_, l.offset - slope_ * (l.device - base_at_));
  }
}

void DeviceTime::reset() {
  const auto last = last_;
  *this = DeviceTime(delay_);
  last_ = last;
}

hal::MonotonicTime DeviceTime::to_host(std::uint32_t ticks, hal::MonotonicTime arrived) {
  if (!begun_) begin(ticks, arrived);
  ticks_ += static_cast<std::int32_t>(ticks - last_ticks_);
  last_ticks_ = ticks;
  double device = static_cast<double>(ticks_) / kTicksPerSecond;
  double offset = hal::seconds(arrived - origin_) - device;
  const double above = offset - (base_ + slope_ * (device - base_at_));
  late_ = above > kLate ? late_ + 1 : 0;
  if (std::abs(above) > kJump || late_ >= kLateInARow) {
    ++jumps_;
    begin(ticks, arrived);
    device = offset = 0;
  }
  if (device - stretch_began_ >= kStretch) {
    close_stretch();
    stretch_began_ = device;
    current_ = {device, offset};
  } else if (offset < current_.offset || (stretches_ == 0 && device == 0)) {
    current_ = {device, offset};
  }
  double line = base_ + slope_ * (device - base_at_);
  // A packet below the line shows at once that the line is too high.
  if (offset < line) {
    base_ += offset - line;
    line = offset;
  }
  const auto captured = origin_ + hal::from_seconds(device + line) - delay_;
  last_ = std::min(std::max(captured, last_ + std::chrono::nanoseconds(1)), std::max(arrived, last_ + std::chrono::nanoseconds(1)));
  return last_;
}

}  // namespace booth::drivers::kinect2

// Two ways of waiting: for a clock (own pace) or for the slowest of the other cameras (fast).
#include "drivers/pacing/timeline.hpp"

#include <algorithm>

namespace booth::drivers {
namespace {

// A sleep through hal::Clock cannot be interrupted; slices this long bound how late stop() wakes a reader.
constexpr hal::Nanoseconds kSlice = std::chrono::milliseconds(10);

}  // namespace

Timeline::Timeline(Pace pace, std::shared_ptr<hal::Clock> clock, int lanes, hal::Nanoseconds fast_lead)
    : pace_(pace),
      clock_(std::move(clock)),
      fast_lead_(fast_lead),
      origin_(kFastOrigin.time_since_epoch().count()),
      begun_(pace == Pace::fast),
      lanes_(static_cast<std::size_t>(lanes)) {}

void Timeline::enter(int lane) {
  const std::lock_guard lock(mutex_);
  if (!begun_) {
    origin_ = clock_->now().time_since_epoch().count();
    begun_ = true;
  }
  lanes_[static_cast<std::size_t>(lane)].streaming = true;
  changed_.notify_all();
}

void Timeline::leave(int lane) noexcept {
  const std::lock_guard lock(mutex_);
  lanes_[static_cast<std::size_t>(lane)].streaming = false;
  changed_.notify_all();
}

void Timeline::advance(int lane, hal::Nanoseconds next_frame, bool finished) {
  const std::lock_guard lock(mutex_);
  auto& l = lanes_[static_cast<std::size_t>(lane)];
  l.next = next_frame;
  l.finished = finished;
  if (pace_ == Pace::fast) changed_.notify_all();
}

bool Timeline::may_go(int lane, hal::Nanoseconds frame) const {
  for (std::size_t i = 0; i < lanes_.size(); ++i)
    if (static_cast<int>(i) != lane && lanes_[i].streaming && !lanes_[i].finished && frame > lanes_[i].next + fast_lead_) return false;
  return true;
}

Timeline::Wait Timeline::wait(int lane, hal::Nanoseconds frame, hal::Nanoseconds delay, hal::Nanoseconds timeout) {
  std::unique_lock lock(mutex_);
  const auto& me = lanes_[static_cast<std::size_t>(lane)];
  if (pace_ == Pace::fast) {
    changed_.wait_for(lock, timeout, [&] { return !me.streaming || may_go(lane, frame); });
    if (!me.streaming) return Wait::stopped;
    return may_go(lane, frame) ? Wait::due : Wait::timeout;
  }
  const auto due = origin() + frame + delay;
  auto now = clock_->now();
  const auto give_up = now + timeout;
  while (true) {
    if (!me.streaming) return Wait::stopped;
    if (now >= due) return Wait::due;
    if (now >= give_up) return Wait::timeout;
    lock.unlock();
    clock_->sleep_until(std::min({due, give_up, now + kSlice}));
    lock.lock();
    now = clock_->now();
  }
}

}  // namespace booth::drivers

// When each camera's next frame may be handed out: one timeline is shared by all cameras of a simulated or recorded booth.
#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <vector>

#include "drivers/source.hpp"
#include "hal/clock.hpp"

namespace booth::drivers {

/// Source time (seconds since the scene or the recording began) against monotonic time, and the waiting of the cameras ("lanes"). Thread-safe.
class Timeline {
 public:
  /// Monotonic time of source time zero at Pace::fast.
  static constexpr hal::MonotonicTime kFastOrigin{std::chrono::seconds(1)};

  enum class Wait : std::uint8_t { due, timeout, stopped };

  Timeline(Pace pace, std::shared_ptr<hal::Clock> clock, int lanes, hal::Nanoseconds fast_lead);

  Pace pace() const { return pace_; }
  hal::Clock& clock() const { return *clock_; }

  /// Monotonic time of source time zero: the first enter() fixes it at Pace::own.
  hal::MonotonicTime origin() const { return hal::MonotonicTime(hal::Nanoseconds(origin_.load())); }
  bool begun() const { return begun_.load(); }

  /// A lane begins or ends streaming; leave() wakes its wait().
  void enter(int lane);
  void leave(int lane) noexcept;

  /// Until the frame of source time `frame`, which is ready `delay` after it was taken, may be handed out.
  Wait wait(int lane, hal::Nanoseconds frame, hal::Nanoseconds delay, hal::Nanoseconds timeout);
  /// The lane's next frame, before the first and after one was handed out; `finished` when there is none.
  void advance(int lane, hal::Nanoseconds next_frame, bool finished);

 private:
  struct Lane {
    bool streaming = false, finished = false;
    hal::Nanoseconds next{};
  };
  bool may_go(int lane, hal::Nanoseconds frame) const;

  const Pace pace_;
  const std::shared_ptr<hal::Clock> clock_;
  const hal::Nanoseconds fast_lead_;
  std::atomic<std::int64_t> origin_;
  std::atomic<bool> begun_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Lane> lanes_;
};

}  // namespace booth::drivers

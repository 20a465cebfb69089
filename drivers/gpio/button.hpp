// From edges to presses: debouncing in the kernel's time, and the two ways in which a button goes wrong, stuck and chattering.
#pragma once

#include <optional>

#include "hal/time.hpp"

namespace booth::drivers::gpio {

/// A level that has settled; `at` is the first edge on the way to it.
struct ButtonChange {
  bool active = false;
  hal::MonotonicTime at{};
};

/// Pure: no threads, no clock. Times are those of the edges, so that a reader who comes late decides as one who was there.
class Button {
 public:
  struct Settings {
    hal::Nanoseconds debounce = std::chrono::milliseconds(20);  ///< a level counts when nothing has moved for so long
    hal::Nanoseconds stuck{0};                                  ///< active for so long is a fault; 0: never (an emergency stop stays pressed by design)
    int edges_per_second = 200;                                 ///< more is a loose contact or an unconnected wire, not a person
  };
  explicit Button(Settings settings) : settings_(settings) {}

  /// The level when the line was opened; it is not a change.
  void begin(bool active, hal::MonotonicTime now);
  /// An edge, and the change that had settled before it, if one had. An edge older than the last counts as simultaneous.
  std::optional<ButtonChange> edge(bool active, hal::MonotonicTime at);
  /// No further edge has come until `now`.
  std::optional<ButtonChange> tick(hal::MonotonicTime now);

  bool active() const { return settled_; }         ///< after debouncing
  bool last_level() const { return last_level_; }  ///< of the last edge
  bool moving() const { return moving_; }
  bool stuck(hal::MonotonicTime now) const { return settled_ && settings_.stuck.count() > 0 && now - since_ >= settings_.stuck; }
  /// More edges within a second than a person can make.
  bool chatters() const { return edges_ > settings_.edges_per_second; }
  /// When tick() will next have something to say; MonotonicTime::max() when an edge must come first.
  hal::MonotonicTime next() const { return moving_ ? last_ + settings_.debounce : hal::MonotonicTime::max(); }

 private:
  Settings settings_;
  bool settled_ = false, last_level_ = false, moving_ = false;
  hal::MonotonicTime since_{}, first_{}, last_{}, window_{};
  int edges_ = 0;
};

}  // namespace booth::drivers::gpio

// A burst of edges counts once it has been quiet for the debounce time, as what it ended with.
#include "drivers/gpio/button.hpp"

#include <algorithm>

namespace booth::drivers::gpio {

void Button::begin(bool active, hal::MonotonicTime now) {
  settled_ = last_level_ = active;
  moving_ = false;
  since_ = first_ = last_ = window_ = now;
  edges_ = 0;
}

std::optional<ButtonChange> Button::edge(bool active, hal::MonotonicTime at) {
  at = std::max(at, last_);
  const auto settled = tick(at);
  if (!moving_) first_ = at;
  moving_ = true;
  last_level_ = active;
  last_ = at;
  if (at - window_ >= std::chrono::seconds(1)) {
    window_ = at;
    edges_ = 0;
  }
  ++edges_;
  return settled;
}

std::optional<ButtonChange> Button::tick(hal::MonotonicTime now) {
  if (!moving_ || now - last_ < settings_.debounce) return std::nullopt;
  moving_ = false;
  if (last_level_ == settled_) return std::nullopt;  // a spike
  settled_ = last_level_;
  since_ = first_;
  return ButtonChange{settled_, first_};
}

}  // namespace booth::drivers::gpio

// When a lamp or a buzzer is on: patterns as tables of times, so that the page for operators and the code say the same.
#pragma once

#include <span>

#include "hal/panel.hpp"
#include "hal/time.hpp"

namespace booth::drivers::gpio {

/// On or off for so long.
struct Beat {
  bool on = false;
  int milliseconds = 0;
};

/// What an output does at a moment, and how long it certainly goes on doing it (hal::Nanoseconds::max(): for ever).
struct Moment {
  bool on = false;
  hal::Nanoseconds left = hal::Nanoseconds::max();
};

/// The light, `since` after the show began.
Moment light_at(const hal::LightShow& show, hal::Nanoseconds since);
/// The buzzer, `since` after the sound began; off for ever after its end.
Moment sound_at(hal::Sound sound, hal::Nanoseconds since);

}  // namespace booth::drivers::gpio

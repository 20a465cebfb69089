// The tables, and where in them a moment lies.
#include "drivers/gpio/rhythm.hpp"

#include <algorithm>
#include <array>

namespace booth::drivers::gpio {
namespace {

using std::chrono::milliseconds;

constexpr Beat kOff[]{{false, 1000}};
constexpr Beat kIdle[]{{true, 1000}};
constexpr Beat kCountdown[]{{true, 120}, {false, 120}, {true, 120}, {false, 640}};
constexpr Beat kEstimating[]{{true, 125}, {false, 125}};
// Lit like idle but for a wink: with one lamp nothing else tells "ready" from "this is you".
constexpr Beat kTracking[]{{true, 1850}, {false, 150}};
constexpr Beat kSearching[]{{true, 1000}, {false, 1000}};
constexpr Beat kSaving[]{{true, 100}, {false, 900}};
constexpr Beat kCodeBlink[]{{true, 250}, {false, 250}};
constexpr Beat kCodePause[]{{false, 1250}};

constexpr Beat kAccepted[]{{true, 80}};
constexpr Beat kRefused[]{{true, 60}, {false, 60}, {true, 60}, {false, 60}, {true, 60}};
constexpr Beat kCount[]{{true, 40}};
constexpr Beat kFound[]{{true, 120}, {false, 120}, {true, 120}};
constexpr Beat kEnded[]{{true, 600}};

constexpr hal::Nanoseconds kUntilFlicker = milliseconds(5000), kFlicker = milliseconds(600), kFlickerBeat = milliseconds(50);

std::span<const Beat> light_beats(hal::LightPattern pattern) {
  switch (pattern) {
    case hal::LightPattern::idle_steady:
      return kIdle;
    case hal::LightPattern::countdown_double_blink:
      return kCountdown;
    case hal::LightPattern::estimating_fast_blink:
      return kEstimating;
    case hal::LightPattern::tracking_on:
      return kTracking;
    case hal::LightPattern::searching_slow_blink:
      return kSearching;
    case hal::LightPattern::saving_flash:
      return kSaving;
    case hal::LightPattern::off:
    case hal::LightPattern::fault_code:
      break;
  }
  return kOff;
}

std::span<const Beat> sound_beats(hal::Sound sound) {
  switch (sound) {
    case hal::Sound::accepted:
      return kAccepted;
    case hal::Sound::refused:
      return kRefused;
    case hal::Sound::countdown:
      return kCount;
    case hal::Sound::found:
      return kFound;
    case hal::Sound::ended:
      return kEnded;
  }
  return kCount;
}

hal::Nanoseconds length(std::span<const Beat> beats) {
  hal::Nanoseconds out{0};
  for (const Beat& b : beats) out += milliseconds(b.milliseconds);
  return out;
}

/// `at` must lie within the beats.
Moment within(std::span<const Beat> beats, hal::Nanoseconds at) {
  for (const Beat& b : beats) {
    if (at < milliseconds(b.milliseconds)) return {b.on, milliseconds(b.milliseconds) - at};
    at -= milliseconds(b.milliseconds);
  }
  return {false, milliseconds(1)};
}

Moment pattern_at(const hal::LightShow& show, hal::Nanoseconds since) {
  if (show.pattern == hal::LightPattern::fault_code) {
    const hal::Nanoseconds blinks = std::clamp(show.code, 1, 9) * length(kCodeBlink);
    since %= blinks + length(kCodePause);
    return since < blinks ? within(kCodeBlink, since % length(kCodeBlink)) : within(kCodePause, since - blinks);
  }
  const auto beats = light_beats(show.pattern);
  if (beats.size() == 1) return {beats[0].on, hal::Nanoseconds::max()};
  return within(beats, since % length(beats));
}

}  // namespace

Moment light_at(const hal::LightShow& show, hal::Nanoseconds since) {
  if (!show.degraded || show.pattern == hal::LightPattern::off) return pattern_at(show, since);
  // The pattern stands still while the light flickers, so that it goes on where it was.
  const hal::Nanoseconds turn = kUntilFlicker + kFlicker, at = since % turn;
  if (at >= kUntilFlicker) {
    const hal::Nanoseconds in = at - kUntilFlicker;
    return {(in / kFlickerBeat) % 2 == 1, kFlickerBeat - in % kFlickerBeat};
  }
  Moment out = pattern_at(show, (since / turn) * kUntilFlicker + at);
  out.left = std::min(out.left, kUntilFlicker - at);
  return out;
}

Moment sound_at(hal::Sound sound, hal::Nanoseconds since) {
  const auto beats = sound_beats(sound);
  return since < length(beats) ? within(beats, since) : Moment{};
}

}  // namespace booth::drivers::gpio

// Three small tables.
#include "daemon/calibrate/capture_cue.hpp"

namespace booth::daemon {

std::string_view to_string(CaptureCue cue) {
  switch (cue) {
    case CaptureCue::search:
      return "search";
    case CaptureCue::hold_still:
      return "hold-still";
    case CaptureCue::elsewhere:
      return "elsewhere";
    case CaptureCue::captured:
      return "captured";
    case CaptureCue::wrong_board:
      return "wrong-board";
    case CaptureCue::done:
      return "done";
  }
  return "unknown";
}

hal::LightPattern light_of(CaptureCue cue) {
  switch (cue) {
    case CaptureCue::hold_still:
      return hal::LightPattern::estimating_fast_blink;
    case CaptureCue::captured:
      return hal::LightPattern::tracking_on;
    case CaptureCue::elsewhere:
    case CaptureCue::done:
      return hal::LightPattern::idle_steady;
    case CaptureCue::search:
    case CaptureCue::wrong_board:
      break;
  }
  return hal::LightPattern::searching_slow_blink;
}

std::optional<hal::Sound> sound_of(CaptureCue cue) {
  if (cue == CaptureCue::captured) return hal::Sound::accepted;
  if (cue == CaptureCue::wrong_board) return hal::Sound::refused;
  if (cue == CaptureCue::done) return hal::Sound::ended;
  return std::nullopt;
}

}  // namespace booth::daemon

// What the person who holds the board hears and sees: words, light and sound for each moment of a capture.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "hal/panel.hpp"

namespace booth::daemon {

enum class CaptureCue : std::uint8_t {
  search,       ///< no two cameras see the board
  hold_still,   ///< they do, and it moves
  elsewhere,    ///< it is still, at a place that was taken already
  captured,     ///< a view was taken
  wrong_board,  ///< a board, not ours
  done,         ///< views are enough
};
std::string_view to_string(CaptureCue cue);

/// docs/guide/calibrate.md has the table.
hal::LightPattern light_of(CaptureCue cue);
/// Nothing where the moment has no sound.
std::optional<hal::Sound> sound_of(CaptureCue cue);

}  // namespace booth::daemon

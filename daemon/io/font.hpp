// The letters of captions, so that a picture needs no font file.
#pragma once

#include <array>
#include <cstdint>

namespace booth::daemon {

inline constexpr int kGlyphWidth = 5, kGlyphHeight = 7;
/// Rows from the top; bit 4 is the leftmost pixel.
using Glyph = std::array<std::uint8_t, kGlyphHeight>;

/// Lower case gives capitals; a character without a glyph gives a box.
const Glyph& glyph(char c);

}  // namespace booth::daemon

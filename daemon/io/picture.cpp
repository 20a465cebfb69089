// Pixels, and the few shapes that pictures of fits are made of.
#include "daemon/io/picture.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "daemon/io/font.hpp"

namespace booth::daemon {

Picture::Picture(int width, int height, Colour background) : width_(width), height_(height) {
  constexpr int kMost = 16384;
  if (width < 1 || height < 1 || width > kMost || height > kMost) throw std::invalid_argument("a picture must be 1 to 16384 pixels wide and high");
  pixels_.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), background);
}

void Picture::blend(int x, int y, Colour c, float opacity) {
  if (x < 0 || x >= width_ || y < 0 || y >= height_) return;
  Colour& p = pixels_[index(x, y)];
  const auto mix = [opacity](std::uint8_t below, std::uint8_t above) {
    return static_cast<std::uint8_t>(std::lround(static_cast<float>(below) * (1 - opacity) + static_cast<float>(above) * opacity));
  };
  p = {mix(p.red, c.red), mix(p.green, c.green), mix(p.blue, c.blue)};
}

void Picture::line(float x0, float y0, float x1, float y1, float thickness, Colour c) {
  constexpr float kFar = 1e5f;
  for (const float v : {x0, y0, x1, y1, thickness})
    if (!(std::abs(v) < kFar)) return;
  const float radius = std::max(thickness / 2, 0.5f);
  const int left = std::max(0, static_cast<int>(std::floor(std::min(x0, x1) - radius - 1)));
  const int right = std::min(width_ - 1, static_cast<int>(std::ceil(std::max(x0, x1) + radius + 1)));
  const int top = std::max(0, static_cast<int>(std::floor(std::min(y0, y1) - radius - 1)));
  const int bottom = std::min(height_ - 1, static_cast<int>(std::ceil(std::max(y0, y1) + radius + 1)));
  const float dx = x1 - x0, dy = y1 - y0, length2 = dx * dx + dy * dy;
  for (int y = top; y <= bottom; ++y)
    for (int x = left; x <= right; ++x) {
      const float px = static_cast<float>(x) - x0, py = static_cast<float>(y) - y0;
      const float t = length2 > 0 ? std::clamp((px * dx + py * dy) / length2, 0.0f, 1.0f) : 0.0f;
      const float distance = std::hypot(px - t * dx, py - t * dy);
      const float cover = std::clamp(radius + 0.5f - distance, 0.0f, 1.0f);
      if (cover > 0) blend(x, y, c, cover);
    }
}

void Picture::text(int x, int y, std::string_view text, Colour c, int scale) {
  int left = x;
  for (const char character : text) {
    if (character == '\n') {
      left = x;
      y += (kGlyphHeight + 2) * scale;
      continue;
    }
    const Glyph& rows = glyph(character);
    for (int row = 0; row < kGlyphHeight * scale; ++row)
      for (int column = 0; column < kGlyphWidth * scale; ++column)
        if (rows[static_cast<std::size_t>(row / scale)] >> (kGlyphWidth - 1 - column / scale) & 1) set(left + column, y + row, c);
    left += (kGlyphWidth + 1) * scale;
  }
}

void Picture::caption(std::string_view words, int scale) {
  if (words.empty()) return;
  const int lines = 1 + static_cast<int>(std::count(words.begin(), words.end(), '\n'));
  const int band = lines * (kGlyphHeight + 2) * scale + 3 * scale;
  for (int y = height_ - band; y < height_; ++y)
    for (int x = 0; x < width_; ++x) blend(x, y, {0, 0, 0}, 0.7f);
  text(2 * scale, height_ - band + 2 * scale, words, {255, 255, 255}, scale);
}

Picture Picture::rotated(int degrees) const {
  if (degrees != 0 && degrees != 90 && degrees != 180 && degrees != 270) throw std::invalid_argument("a picture is turned by 0, 90, 180 or 270 degrees");
  const bool lying = degrees == 90 || degrees == 270;
  if (width_ == 0) return *this;
  Picture out(lying ? height_ : width_, lying ? width_ : height_);
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) {
      const Colour c = at(x, y);
      switch (degrees) {
        case 0:
          out.set(x, y, c);
          break;
        case 90:
          out.set(height_ - 1 - y, x, c);
          break;
        case 180:
          out.set(width_ - 1 - x, height_ - 1 - y, c);
          break;
        default:
          out.set(y, width_ - 1 - x, c);
      }
    }
  return out;
}

Picture Picture::halved() const {
  Picture out(std::max(1, width_ / 2), std::max(1, height_ / 2));
  for (int y = 0; y < out.height_; ++y)
    for (int x = 0; x < out.width_; ++x) {
      int red = 0, green = 0, blue = 0;
      for (int k = 0; k < 4; ++k) {
        const Colour c = at(std::min(2 * x + k % 2, width_ - 1), std::min(2 * y + k / 2, height_ - 1));
        red += c.red, green += c.green, blue += c.blue;
      }
      const auto quarter = [](int sum) { return static_cast<std::uint8_t>((sum + 2) / 4); };
      out.set(x, y, {quarter(red), quarter(green), quarter(blue)});
    }
  return out;
}

Picture Picture::beside(const std::vector<Picture>& pictures, int gap) {
  int width = -gap, height = 0;
  for (const Picture& p : pictures) width += p.width_ + gap, height = std::max(height, p.height_);
  Picture out(width, height, {255, 255, 255});
  int left = 0;
  for (const Picture& p : pictures) {
    for (int y = 0; y < p.height_; ++y)
      for (int x = 0; x < p.width_; ++x) out.set(left + x, y, p.at(x, y));
    left += p.width_ + gap;
  }
  return out;
}

}  // namespace booth::daemon

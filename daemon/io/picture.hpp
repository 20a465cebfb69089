// A small drawing board in memory, for pictures of fits: pixels, lines, discs and captions.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

namespace booth::daemon {

struct Colour {
  std::uint8_t red = 0, green = 0, blue = 0;
};

/// 8-bit RGB, row-major from the top left. Drawing outside is clipped.
class Picture {
 public:
  Picture() = default;
  /// Throws std::invalid_argument unless 1 <= width, height <= 16384.
  Picture(int width, int height, Colour background = {});

  int width() const { return width_; }
  int height() const { return height_; }
  Colour at(int x, int y) const { return pixels_[index(x, y)]; }
  const std::vector<Colour>& pixels() const { return pixels_; }

  void set(int x, int y, Colour c) {
    if (x >= 0 && x < width_ && y >= 0 && y < height_) pixels_[index(x, y)] = c;
  }
  /// opacity 0..1.
  void blend(int x, int y, Colour c, float opacity);
  /// A line with round ends; coordinates and thickness in pixels, smooth edges. Ends that are not finite or absurdly far away draw nothing.
  void line(float x0, float y0, float x1, float y1, float thickness, Colour c);
  void disc(float x, float y, float radius, Colour c) { line(x, y, x, y, 2 * radius, c); }
  /// Built-in 5 x 7 letters times `scale`, top left at (x, y); lower case is drawn as capitals, unknown characters as a box. Newlines begin a line.
  void text(int x, int y, std::string_view text, Colour c, int scale = 2);
  /// A dark band with the text at the bottom edge of the picture.
  void caption(std::string_view text, int scale = 2);

  /// Turned clockwise by 0, 90, 180 or 270 degrees; std::invalid_argument otherwise.
  Picture rotated(int degrees) const;
  /// Half as large, every pixel the mean of four (odd edges are cut).
  Picture halved() const;
  /// Pictures of one height side by side with a gap.
  static Picture beside(const std::vector<Picture>& pictures, int gap = 4);

 private:
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x); }
  int width_ = 0, height_ = 0;
  std::vector<Colour> pixels_;
};

}  // namespace booth::daemon

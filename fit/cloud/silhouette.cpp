// Two sweeps that carry each node's way to its nearest person pixel on to its neighbours.
#include "fit/cloud/silhouette.hpp"

#include <algorithm>
#include <cstdlib>

namespace booth::fit {
namespace {

struct Map {
  std::int16_t* dx;
  std::int16_t* dy;
  int width, height;

  void relax(int x, int y, int from_x, int from_y) const {
    if (from_x < 0 || from_y < 0 || from_x >= width || from_y >= height) return;
    const int from = from_y * width + from_x, to = y * width + x;
    if (dx[from] == kSilhouetteFar) return;
    const int nx = dx[from] + (from_x - x) * kSilhouetteStep, ny = dy[from] + (from_y - y) * kSilhouetteStep;
    if (std::abs(nx) >= kSilhouetteFar || std::abs(ny) >= kSilhouetteFar) return;
    if (dx[to] == kSilhouetteFar || nx * nx + ny * ny < dx[to] * dx[to] + dy[to] * dy[to])
      dx[to] = static_cast<std::int16_t>(nx), dy[to] = static_cast<std::int16_t>(ny);
  }
};

}  // namespace

void map_silhouette(View& view) {
  const int pixels_across = view.camera.width;
  const Map map{view.nearest_dx.data(), view.nearest_dy.data(), silhouette_places(pixels_across), silhouette_places(view.camera.height)};
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      int best = 2 * kSilhouetteStep * kSilhouetteStep, best_dx = kSilhouetteFar, best_dy = kSilhouetteFar;
      // Images that are no whole number of steps across have smaller blocks at the edge.
      const int rows = std::min(kSilhouetteStep, view.camera.height - y * kSilhouetteStep);
      const int columns = std::min(kSilhouetteStep, pixels_across - x * kSilhouetteStep);
      for (int j = 0; j < rows; ++j) {
        const PixelLabel* label = view.label.data() + (y * kSilhouetteStep + j) * pixels_across + x * kSilhouetteStep;
        for (int i = 0; i < columns; ++i)
          if (label[i] == PixelLabel::person && i * i + j * j < best) best = i * i + j * j, best_dx = i, best_dy = j;
      }
      map.dx[y * map.width + x] = static_cast<std::int16_t>(best_dx);
      map.dy[y * map.width + x] = static_cast<std::int16_t>(best_dy);
    }
  }
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      map.relax(x, y, x - 1, y);
      for (int k = -1; k <= 1; ++k) map.relax(x, y, x + k, y - 1);
    }
    for (int x = map.width - 1; x >= 0; --x) map.relax(x, y, x + 1, y);
  }
  for (int y = map.height - 1; y >= 0; --y) {
    for (int x = map.width - 1; x >= 0; --x) {
      map.relax(x, y, x + 1, y);
      for (int k = -1; k <= 1; ++k) map.relax(x, y, x + k, y + 1);
    }
    for (int x = 0; x < map.width; ++x) map.relax(x, y, x - 1, y);
  }
}

}  // namespace booth::fit

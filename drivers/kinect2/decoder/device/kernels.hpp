// The decode as three kernels: phases from packed codes, depth from filtered phases, and the edge filter.
#pragma once

#include <cstdint>

#include "drivers/kinect2/decoder/constants.hpp"
#include "drivers/kinect2/decoder/one_lane.hpp"
#include "drivers/kinect2/decoder/phase_maths.hpp"
#include "drivers/kinect2/layout.hpp"
#include "fit/gpu/launch.hpp"

namespace booth::drivers::kinect2::device {

using gpu::Lane;

/// What crosses the bus at once.
struct alignas(16) Words {
  std::uint32_t word[4];
};
inline constexpr int kDecodedImages = 9, kRowWords = static_cast<int>(kRowBytes / sizeof(Words)), kImageWords = kRowWords * kHeight;
static_assert(kRowBytes % sizeof(Words) == 0);

/// Pinned; what changes from frame to frame, and the mark that the last kernel ran.
struct DecodeOrder {
  std::uint32_t number = 0, done = 0;
  std::uint32_t infrared = 0;  ///< whether that picture is wanted
};

/// Device memory, and the host's that both see. Images are kPixels, row-major; of the device's columns unless they say otherwise.
struct DecodeMemory {
  DecodeOrder* order;               ///< pinned
  const Words* images;              ///< pinned: kDecodedImages packed images, one after the other
  std::uint16_t *depth, *infrared;  ///< pinned; not mirrored
  float* millimetres;               ///< pinned, for tests; or null
  const float *cosine[3], *sine[3], *xu, *s;
  float *length[3], *a[3], *b[3];  ///< phase vectors
  float *sum, *range;
  DecodeNumbers numbers;
};

/// A block takes every so many rows of the picture: their packed codes come over the bus, once and in whole words, and become phase vectors.
struct MeasurePhases {
  static constexpr int kThreads = 256, kPhases = 2;
  struct Shared {
    Words row[kDecodedImages * kRowWords + 1];  ///< and a word more, since a code is read as three bytes
  };
  struct Private {};
  explicit MeasurePhases(const DecodeMemory& memory) : m(memory) {}
  DecodeMemory m;

  BOOTH_HOST_DEVICE int rounds(const Lane& lane) const { return (kHeight - lane.block + lane.blocks - 1) / lane.blocks; }
  template <int kPhase>
  BOOTH_HOST_DEVICE bool runs(int) const {
    return true;
  }

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int round, Shared& s, Private&) const {
    const int r = round * lane.blocks + lane.block;
    if constexpr (kPhase == 0) {
      const Words* from = m.images + raw_row(r) * kRowWords;
      for (int i = lane.thread; i < kDecodedImages * kRowWords; i += kThreads) s.row[i] = from[i / kRowWords * kImageWords + i % kRowWords];
    } else {
      const unsigned char* bytes = reinterpret_cast<const unsigned char*>(s.row);
      for (int c = lane.thread; c < kWidth; c += kThreads) {
        const int pixel = r * kWidth + c, bit = 11 * slot_of(c);
        std::uint32_t code[kDecodedImages];
        for (int i = 0; i < kDecodedImages; ++i) {
          const unsigned char* p = bytes + i * static_cast<int>(kRowBytes) + bit / 8;
          const std::uint32_t three = p[0] | static_cast<std::uint32_t>(p[1]) << 8 | static_cast<std::uint32_t>(p[2]) << 16;
          code[i] = c == 0 || c == kWidth - 1 ? 0 : three >> (bit & 7) & 0x7FFu;  // the outer columns carry no measurement
        }
        float infrared = 0;
        for (int f = 0; f < 3; ++f) {
          const PhaseVector<OneLane> v = measure_phase<OneLane>(code[3 * f], code[3 * f + 1], code[3 * f + 2], m.cosine[f][pixel], m.sine[f][pixel]);
          m.length[f][pixel] = v.length, m.a[f][pixel] = v.a, m.b[f][pixel] = v.b;
          infrared += v.infrared;
        }
        if (m.order->infrared != 0) m.infrared[r * kWidth + kWidth - 1 - c] = to_count(infrared, kInfraredPerSum);
      }
    }
  }
};

/// A tile of the picture and the pixels around it, for filters of 3 x 3.
struct Tile {
  static constexpr int kWide = 32, kHigh = 8, kAcross = kWide + 2, kDown = kHigh + 2, kArea = kAcross * kDown;
  static constexpr int kColumns = kWidth / kWide, kTiles = kColumns * (kHeight / kHigh);
  static_assert(kWidth % kWide == 0 && kHeight % kHigh == 0);
  int left, top;  ///< of its first pixel

  BOOTH_HOST_DEVICE explicit Tile(int number) : left(number % kColumns * kWide), top(number / kColumns * kHigh) {}
  /// The pixel at place i of the tile with its border; -1 off the picture.
  BOOTH_HOST_DEVICE int pixel(int i) const {
    const int c = left + i % kAcross - 1, r = top + i / kAcross - 1;
    return c < 0 || r < 0 || c >= kWidth || r >= kHeight ? -1 : r * kWidth + c;
  }
  /// Where thread t's own pixel is there.
  BOOTH_HOST_DEVICE static int place(int t) { return (t / kWide + 1) * kAcross + t % kWide + 1; }
  BOOTH_HOST_DEVICE static bool inner_row(int pixel) { return pixel >= kWidth && pixel < kWidth * (kHeight - 1); }
};

/// What kernels share that take a block a tile, a thread a pixel.
struct TileKernel {
  static constexpr int kThreads = Tile::kWide * Tile::kHigh, kPhases = 2;
  struct Private {};
  explicit TileKernel(const DecodeMemory& memory) : m(memory) {}
  DecodeMemory m;

  BOOTH_HOST_DEVICE int rounds(const Lane& lane) const { return (Tile::kTiles - lane.block + lane.blocks - 1) / lane.blocks; }
  template <int kPhase>
  BOOTH_HOST_DEVICE bool runs(int) const {
    return true;
  }
  BOOTH_HOST_DEVICE static Tile tile(const Lane& lane, int round) { return Tile(round * lane.blocks + lane.block); }
};

/// The bilateral filter over phase vectors, then amplitudes and range.
struct FilterPhases : TileKernel {
  struct Shared {
    float length[3][Tile::kArea], a[3][Tile::kArea], b[3][Tile::kArea];
  };
  using TileKernel::TileKernel;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int round, Shared& s, Private&) const {
    const Tile t = tile(lane, round);
    if constexpr (kPhase == 0) {
      for (int i = lane.thread; i < Tile::kArea; i += kThreads) {
        const int pixel = t.pixel(i);
        for (int f = 0; f < 3; ++f) {
          s.length[f][i] = pixel < 0 ? 0 : m.length[f][pixel];
          s.a[f][i] = pixel < 0 ? 0 : m.a[f][pixel];
          s.b[f][i] = pixel < 0 ? 0 : m.b[f][pixel];
        }
      }
    } else {
      using L = OneLane;
      const int i = Tile::place(lane.thread), pixel = t.pixel(i);
      const bool filter = m.numbers.bilateral && Tile::inner_row(pixel);
      Polar<L> p[3];
      bool agree = true;
      for (int f = 0; f < 3; ++f) {
        if (!filter) {
          const float n = s.length[f][i];
          p[f] = polar<L>(n * s.a[f][i], n * s.b[f][i], 1);
          continue;
        }
        const auto at = [&](int dr, int dc) {
          const int q = i + dr * Tile::kAcross + dc;
          return PhaseVector<L>{s.length[f][q], s.a[f][q], s.b[f][q], 0};
        };
        const SmoothedVector<L> v = smooth_phase<true, L>(m.numbers, at);
        p[f] = polar<L>(v.a, v.b, v.weight);
        agree = agree && v.agree;
      }
      const Ranged<L> out = unwrap_phases<L>(m.numbers, p, agree, m.s[pixel], m.xu[pixel]);
      m.sum[pixel] = out.sum, m.range[pixel] = out.range;
    }
  }
};

/// The edge filter, and the picture, over the bus.
struct AcceptDepth : TileKernel {
  struct Shared {
    float sum[Tile::kArea], range[Tile::kArea];
  };
  using TileKernel::TileKernel;

  template <int kPhase>
  BOOTH_HOST_DEVICE void phase(const Lane& lane, int round, Shared& s, Private&) const {
    const Tile t = tile(lane, round);
    if constexpr (kPhase == 0) {
      for (int i = lane.thread; i < Tile::kArea; i += kThreads) {
        const int pixel = t.pixel(i);
        s.sum[i] = pixel < 0 ? 0 : m.sum[pixel];
        s.range[i] = pixel < 0 ? 0 : m.range[pixel];
      }
    } else {
      using L = OneLane;
      const int i = Tile::place(lane.thread), pixel = t.pixel(i);
      const auto ranged = [&](int at) { return Ranged<L>{s.sum[at], s.range[at]}; };
      const auto column = [&](int at) { return edge_column<L>(ranged(at - Tile::kAcross), ranged(at), ranged(at + Tile::kAcross)); };
      const float z = m.numbers.edge && Tile::inner_row(pixel) ? without_edge<L>(m.numbers, s.range[i], column(i - 1), column(i), column(i + 1))
                                                               : within_limits<L>(m.numbers, s.range[i]);
      const int c = pixel % kWidth;
      m.depth[pixel - c + kWidth - 1 - c] = to_count(z, 1);
      if (m.millimetres != nullptr) m.millimetres[pixel] = z;
      if (lane.block == 0 && lane.thread == 0) m.order->done = m.order->number;
    }
  }
};

}  // namespace booth::drivers::kinect2::device

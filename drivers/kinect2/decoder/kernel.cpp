// The decoder in vectors, a few rows at a time so that nothing leaves the nearest caches; compiled once for each instruction set.
#include <cstdint>

#include "drivers/kinect2/decoder/kernels.hpp"
#include "drivers/kinect2/decoder/lanes.hpp"
#include "drivers/kinect2/decoder/phase_maths.hpp"
#include "drivers/kinect2/decoder/unpack.hpp"

#ifndef BOOTH_DECODE
#error "BOOTH_DECODE must name the function, e.g. decode_avx2"
#endif

namespace booth::drivers::kinect2 {
namespace {

using L = VectorLanes;
using F = L::F;
using M = L::M;

constexpr int W = 512, H = 424, kLanes = L::kLanes;
constexpr std::ptrdiff_t kRow = 704, kImage = kRow * H;

std::ptrdiff_t ring(int r) { return r % kRingRows * kRowFloats; }

/// Phase vectors of one output row, as length and direction, and its infrared.
void measure(const KernelWork& w, const unsigned char* images, int r) {
  const std::ptrdiff_t raw = (r < 212 ? r : 635 - r) * kRow, at = static_cast<std::ptrdiff_t>(r) * W;
  for (int i = 0; i < 9; ++i) {
    std::uint16_t* codes = w.codes + static_cast<std::ptrdiff_t>(i) * W;
    unpack_row(images + i * kImage + raw, codes);
    codes[0] = codes[W - 1] = 0;  // the outer columns carry no measurement
  }
  for (int x = 0; x < W; x += kLanes) {
    F infrared = L::all(0);
    for (int f = 0; f < 3; ++f) {
      const std::uint16_t* codes = w.codes + static_cast<std::ptrdiff_t>(3 * f) * W + x;
      const PhaseVector<L> v = measure_phase<L>(L::load_codes(codes), L::load_codes(codes + W), L::load_codes(codes + 2 * W), L::load(w.cos_p[f] + at + x),
                                                L::load(w.sin_p[f] + at + x));
      const std::ptrdiff_t to = ring(r) + x;
      L::store(w.length[f] + to, v.length);
      L::store(w.unit_a[f] + to, v.a);
      L::store(w.unit_b[f] + to, v.b);
      infrared += v.infrared;
    }
    L::store(w.infrared + x, infrared);
  }
}

void filter_and_unwrap(const KernelWork& w, int r) {
  const std::ptrdiff_t rows[3] = {ring(r + kRingRows - 1), ring(r), ring(r + 1)}, row = rows[1];
  const bool filter = w.numbers.bilateral && r > 0 && r < H - 1;
  for (int x = 0; x < W; x += kLanes) {
    Polar<L> p[3];
    M agree = L::at_least(L::all(0), L::all(0));
    for (int f = 0; f < 3; ++f) {
      const F n = L::load(w.length[f] + row + x);
      if (!filter) {
        p[f] = polar<L>(n * L::load(w.unit_a[f] + row + x), n * L::load(w.unit_b[f] + row + x), L::all(1));
        continue;
      }
      const auto at = [&](int dr, int dc) {
        const std::ptrdiff_t q = rows[dr + 1] + x + dc;
        return PhaseVector<L>{L::load(w.length[f] + q), L::load(w.unit_a[f] + q), L::load(w.unit_b[f] + q), L::all(0)};
      };
      const SmoothedVector<L> v = L::any(L::above(L::all(kWeak), n)) ? smooth_phase<true, L>(w.numbers, at) : smooth_phase<false, L>(w.numbers, at);
      p[f] = polar<L>(v.a, v.b, v.weight);
      agree = L::both(agree, v.agree);
    }
    const std::ptrdiff_t pixel = static_cast<std::ptrdiff_t>(r) * W + x;
    const Ranged<L> out = unwrap_phases<L>(w.numbers, p, agree, L::load(w.s + pixel), L::load(w.xu + pixel));
    L::store(w.sum + row + x, out.sum);
    L::store(w.range + row + x, out.range);
  }
}

/// The row's depth without what lies on the edge between two surfaces.
void accept(const KernelWork& w, int r) {
  const std::ptrdiff_t row = ring(r), above_row = ring(r + kRingRows - 1), below_row = ring(r + 1);
  float* depth = w.depth + static_cast<std::ptrdiff_t>(r) * W;
  if (!w.numbers.edge || r == 0 || r == H - 1) {
    for (int x = 0; x < W; x += kLanes) L::store(depth + x, within_limits<L>(w.numbers, L::load(w.range + row + x)));
    return;
  }
  const auto ranged = [&](std::ptrdiff_t at) { return Ranged<L>{L::load(w.sum + at), L::load(w.range + at)}; };
  for (int x = 0; x < W; x += kLanes) {
    const EdgeColumn<L> column = edge_column<L>(ranged(above_row + x), ranged(row + x), ranged(below_row + x));
    L::store(w.column[0] + x, column.sum);
    L::store(w.column[1] + x, column.squares);
    L::store(w.column[2] + x, column.nearest);
    L::store(w.column[3] + x, column.farthest);
  }
  const auto column = [&](int x) {
    return EdgeColumn<L>{L::load(w.column[0] + x), L::load(w.column[1] + x), L::load(w.column[2] + x), L::load(w.column[3] + x)};
  };
  for (int x = 0; x < W; x += kLanes) L::store(depth + x, without_edge<L>(w.numbers, L::load(w.range + row + x), column(x - 1), column(x), column(x + 1)));
}

/// To whole numbers, and from the device's mirrored columns to ours.
void write_row(const float* from, float scale, std::uint16_t* to) {
#pragma GCC ivdep
  for (int x = 0; x < W; ++x) to[W - 1 - x] = to_count(from[x], scale);
}

}  // namespace

void BOOTH_DECODE(const KernelWork& w, const unsigned char* images, std::uint16_t* depth, std::uint16_t* infrared) {
  // Each stage runs a row behind the one before.
  for (int r = 0; r < H + 2; ++r) {
    if (r < H) {
      measure(w, images, r);
      if (infrared != nullptr) write_row(w.infrared, kInfraredPerSum, infrared + static_cast<std::ptrdiff_t>(r) * W);
    }
    if (r >= 1 && r <= H) filter_and_unwrap(w, r - 1);
    if (r >= 2) {
      accept(w, r - 2);
      write_row(w.depth + static_cast<std::ptrdiff_t>(r - 2) * W, 1, depth + static_cast<std::ptrdiff_t>(r - 2) * W);
    }
  }
}

}  // namespace booth::drivers::kinect2

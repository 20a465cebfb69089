// Numbers for training that depend only on a seed and a counter, so that threads and order do not change a database.
#pragma once

#include <cmath>
#include <cstdint>

namespace booth::fit::train {

constexpr std::uint64_t split_mix(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15ull;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
  return x ^ (x >> 31);
}

class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t stream) : state_(split_mix(seed ^ split_mix(stream))) {}
  std::uint64_t next() { return split_mix(state_++); }
  /// In (0, 1).
  double uniform() { return (static_cast<double>(next() >> 11) + 0.5) * 0x1p-53; }
  double normal() {
    const double r = std::sqrt(-2 * std::log(uniform())), turn = 6.283185307179586 * uniform();
    return r * std::cos(turn);
  }
  /// Normal, cut off at +-limit.
  double normal(double sigma, double limit) { return std::fmin(limit, std::fmax(-limit, sigma * normal())); }

 private:
  std::uint64_t state_;
};

}  // namespace booth::fit::train
